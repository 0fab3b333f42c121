"""URDF files, read into the neutral model."""
