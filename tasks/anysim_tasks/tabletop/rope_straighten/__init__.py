"""Lay a rope straight by one of its ends."""
