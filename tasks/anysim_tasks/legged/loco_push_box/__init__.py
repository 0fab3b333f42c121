"""Push a box to a place on four legs."""
