"""Insert a lying peg into a hole in the side of a block."""
