"""Engines that do not work, for a test."""
