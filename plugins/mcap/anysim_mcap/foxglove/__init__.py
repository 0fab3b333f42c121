"""Trajectories as files of which Foxglove draws everything."""
