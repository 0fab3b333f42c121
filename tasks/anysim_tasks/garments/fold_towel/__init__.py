"""Fold a towel in half."""
