"""Batched inverse kinematics for anysim, compiled with numba."""
