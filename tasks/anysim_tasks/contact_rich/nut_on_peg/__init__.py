"""Put a square nut over a peg and let go of it."""
