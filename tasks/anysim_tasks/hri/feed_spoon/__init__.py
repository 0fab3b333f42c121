"""Feed a person beads from a spoon."""
