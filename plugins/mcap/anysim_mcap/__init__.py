"""Trajectories as MCAP files and videos for anysim."""

__version__ = "0.1.0"
