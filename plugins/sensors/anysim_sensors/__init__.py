"""Sensors on one compiled geometry of the neutral model: it knows shapes and poses, and no engine."""
