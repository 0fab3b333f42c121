"""Lift a tray level with two hands."""
