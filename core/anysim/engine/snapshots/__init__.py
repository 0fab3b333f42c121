"""Snapshots: their files, states by name for any engine, and checks of both before anything of them is written."""
