"""A local page of what is installed and recorded, from which views, runs and comparisons are started."""
