"""A barometer for anysim."""
