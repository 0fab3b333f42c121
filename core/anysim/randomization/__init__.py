"""Random streams, distributions, draws and noise."""
