"""Put a gear on a shaft between two others, in mesh with both."""
