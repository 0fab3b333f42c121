"""Stixels for anysim."""
