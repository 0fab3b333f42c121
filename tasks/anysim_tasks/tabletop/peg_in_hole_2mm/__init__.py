"""Insert a square peg into a hole with 2 mm of clearance."""
