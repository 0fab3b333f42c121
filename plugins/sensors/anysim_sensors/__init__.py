"""Sensors: of motion and force, and on one compiled geometry that knows shapes and poses, and no engine."""
