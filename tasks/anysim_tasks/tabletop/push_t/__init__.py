"""Push a T into a pose on the table."""
