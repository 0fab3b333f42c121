"""Compiled kernels of navigation."""
