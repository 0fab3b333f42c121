"""Push a door open on four legs."""
