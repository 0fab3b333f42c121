"""Inverse kinematics for anysim with mink: quadratic programs over MuJoCo's kinematics."""
