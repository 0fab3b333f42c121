"""Pour beads out of a cup into a tray."""
