"""Skills that put things into things that fit."""
