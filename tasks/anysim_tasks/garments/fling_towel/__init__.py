"""Fling a crumpled towel out with two arms."""
