"""The commands under `anysim bench`."""
