"""Tasks of a hand with several fingers."""
