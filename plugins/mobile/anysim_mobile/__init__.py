"""Bases that drive up to things, follow people, and stop for them."""
