"""Skills with cloth, and terms that measure how it lies."""
