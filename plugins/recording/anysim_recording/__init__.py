"""Episodes that are written to disk: who runs them, and what keeps each whole or not at all."""
