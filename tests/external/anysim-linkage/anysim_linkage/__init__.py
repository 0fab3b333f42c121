"""Articulated mechanisms as an engine of anysim."""

__version__ = "0.1.0"
