"""Put one cube on another and let go of it."""
