"""Processes of their own, and the memory that they share with their parent."""
