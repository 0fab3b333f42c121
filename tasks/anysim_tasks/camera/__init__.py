"""Tasks of cameras that fly."""
