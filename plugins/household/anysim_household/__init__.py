"""Household objects and tools, made of convex pieces, and what makes a pack of such things from YAML files."""
