"""Tasks with cloth: towels that are hung up, spread and folded."""
