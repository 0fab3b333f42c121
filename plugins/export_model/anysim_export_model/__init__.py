"""Worlds, robots and objects of anysim, written as URDF and MJCF files."""
