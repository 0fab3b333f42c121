"""Turn a cube on the palm of a hand."""
