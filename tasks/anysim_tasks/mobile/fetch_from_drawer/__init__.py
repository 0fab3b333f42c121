"""Take a cube out of a closed drawer, bring it to a tray, and close the drawer again."""
