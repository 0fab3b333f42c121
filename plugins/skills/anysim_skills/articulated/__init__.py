"""Skills for parts that move on joints: drawers, doors, lids, buttons."""
