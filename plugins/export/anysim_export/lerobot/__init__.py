"""Data sets of LeRobot, format v3.0, written without the package `lerobot`."""
