"""Flatten a crumpled towel."""
