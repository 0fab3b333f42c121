"""Pour water out of a cup into a tray."""
