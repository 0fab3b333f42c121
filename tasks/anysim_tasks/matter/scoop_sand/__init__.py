"""Scoop sand out of a tray into a bowl."""
