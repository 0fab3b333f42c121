"""SAPIEN as an engine of anysim."""
