"""Drive a base to a pose on the ground and stop there."""
