"""Take a bar out of the hand of a person."""
