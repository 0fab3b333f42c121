"""Put a cube down on a round pad and let go of it."""
