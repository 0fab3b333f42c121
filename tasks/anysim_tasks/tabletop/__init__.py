"""Tasks on a table."""
