"""Sensors of motion and force: what a body, a joint or a wrist feels."""
