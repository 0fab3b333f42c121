"""Drive to a counter and take a cube from it."""
