"""Put a mug, taken by what a bank says of it, on a coaster and let go of it."""
