"""Place cubes on a table over which a person reaches too."""
