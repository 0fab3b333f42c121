"""Magnets, fire, smoke and wind beside any engine."""
