"""Put a bar into the hand of a person."""
