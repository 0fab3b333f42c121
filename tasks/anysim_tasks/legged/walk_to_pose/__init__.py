"""Walk to a pose on four legs and stand there."""
