"""Take a cube from one counter and put it into a tray on another."""
