"""Bring the four finger tips of a hand to a goal each."""
