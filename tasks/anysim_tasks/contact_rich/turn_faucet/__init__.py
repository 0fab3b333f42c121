"""Open a tap by its lever."""
