"""Tasks with a person: what is passed, worn, fed, and shared."""
