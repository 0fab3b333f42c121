"""Ray for anysim."""
