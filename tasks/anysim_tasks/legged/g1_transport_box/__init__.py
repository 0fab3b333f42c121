"""Carry a box from one table to another between two palms."""
