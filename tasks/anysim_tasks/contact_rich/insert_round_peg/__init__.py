"""Insert a round peg into a ring with 3 mm of clearance."""
