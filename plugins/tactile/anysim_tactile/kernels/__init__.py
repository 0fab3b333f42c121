"""The compiled arithmetic of touch."""
