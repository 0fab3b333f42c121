"""Generated ground: pieces from physical parameters and a difficulty, and tiles of them."""
