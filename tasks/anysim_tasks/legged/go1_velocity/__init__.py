"""Walk as fast as commanded, on four legs, by positions of the joints."""
