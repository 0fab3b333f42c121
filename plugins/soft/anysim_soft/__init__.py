"""Soft bodies, ropes and cloth: MuJoCo's flex in a world of its own beside any engine."""
