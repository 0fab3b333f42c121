"""Skills with vessels."""
