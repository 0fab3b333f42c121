"""Put a ball into a bowl with the hand of a humanoid."""
