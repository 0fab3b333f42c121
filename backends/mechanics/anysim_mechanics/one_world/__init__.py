"""Engines whose library has a world of its own for each env."""
