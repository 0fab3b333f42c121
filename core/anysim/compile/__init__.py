"""Compilation of a spec into a World, and editing of a World."""
