"""Lift a randomly placed cube to a random goal above the table."""
