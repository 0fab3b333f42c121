"""Put a vial from a rack into a device behind a door, close it, and start it."""
