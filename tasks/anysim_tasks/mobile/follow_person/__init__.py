"""Follow a person who walks, at a distance, and look at them."""
