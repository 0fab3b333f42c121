"""Drafts of catalogue entries: what can be guessed of a robot from its URDF or MJCF file, and what cannot."""
