"""Reach a drawn point above a shelf."""
