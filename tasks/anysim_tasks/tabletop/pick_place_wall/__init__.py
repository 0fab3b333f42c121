"""Carry a cube from one side of a wall to a pad on the other."""
