"""Put a cube into a drawer that is closed before and afterwards."""
