"""Tasks of robots that drive."""
