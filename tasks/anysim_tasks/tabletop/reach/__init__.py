"""Bring the tool to a random point and come to rest."""
