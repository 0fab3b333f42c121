"""Hang a towel over a rail."""
