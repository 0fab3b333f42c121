"""Recovery: what skills do once all else has failed, and where a base can stand or pass."""
