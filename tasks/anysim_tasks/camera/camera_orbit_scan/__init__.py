"""See a thing from all around."""
