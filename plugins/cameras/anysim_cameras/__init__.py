"""Cameras that fly: controllers that move and aim them."""
