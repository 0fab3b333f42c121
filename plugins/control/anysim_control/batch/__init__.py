"""Batched inverse kinematics, compiled with numba or in plain numpy."""
