"""Walk to a point on four legs."""
