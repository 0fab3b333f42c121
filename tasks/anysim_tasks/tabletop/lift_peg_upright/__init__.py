"""Stand a lying peg up and let go of it."""
