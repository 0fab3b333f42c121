"""Lift a cube."""
