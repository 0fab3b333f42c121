"""Push a cube across a table to a disc."""
