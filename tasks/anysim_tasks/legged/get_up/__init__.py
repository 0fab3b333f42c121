"""Get up from the ground and stand, by positions of the joints."""
