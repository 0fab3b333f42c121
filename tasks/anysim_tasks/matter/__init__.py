"""Tasks with matter that flows: fluid, sand and rice."""
