"""Tasks: the Markov decision process over a world."""
