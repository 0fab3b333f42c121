"""Procedural rooms: plans with walls and openings, furniture from primitives, and where there is free space."""
