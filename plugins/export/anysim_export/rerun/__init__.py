"""Recordings of Rerun."""
