"""Trajectories as MCAP files and videos for anysim."""
