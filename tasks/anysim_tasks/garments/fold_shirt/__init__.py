"""Fold the sleeves of a shirt in, and its hem to its shoulders."""
