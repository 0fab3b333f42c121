"""Walk to a pose in an open room on four legs, past what stands at its walls."""
