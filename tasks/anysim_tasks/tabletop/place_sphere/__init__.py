"""Put a ball into a shallow bin."""
