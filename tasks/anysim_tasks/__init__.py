"""The tasks that come with anysim."""
