"""Backends of strands-robots: its simulation contract on each engine of anysim."""
