"""Collecting: many episodes of one or several tasks, and what became of them."""
