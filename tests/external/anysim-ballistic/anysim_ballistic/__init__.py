"""Rigid bodies in free flight, as an engine of anysim."""

__version__ = "0.3.0"
