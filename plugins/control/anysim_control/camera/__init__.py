"""Controllers of cameras."""
