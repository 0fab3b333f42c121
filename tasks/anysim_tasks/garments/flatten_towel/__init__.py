"""Spread a towel that lies folded."""
