"""PyBullet as an engine of anysim."""
