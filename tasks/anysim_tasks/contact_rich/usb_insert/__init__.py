"""Put a USB plug into its port with 0.3 mm of clearance."""
