"""Kinematics and dynamics of one robot, from the neutral World and never from an engine."""
