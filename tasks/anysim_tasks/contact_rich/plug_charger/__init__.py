"""Plug a charger into a socket with 0.5 mm of clearance."""
