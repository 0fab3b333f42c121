"""Fly a camera to a pose, around furniture."""
