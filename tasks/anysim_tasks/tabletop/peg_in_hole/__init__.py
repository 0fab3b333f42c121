"""Insert a square peg into a hole with 3 mm of clearance."""
