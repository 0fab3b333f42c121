"""Tasks of robots that walk on legs."""
