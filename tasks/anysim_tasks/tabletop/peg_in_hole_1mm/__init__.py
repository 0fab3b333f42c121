"""Insert a square peg into a hole with 1 mm of clearance."""
