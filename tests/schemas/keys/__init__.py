"""The keys of a RunSpec, a change of each, and what shows it."""
