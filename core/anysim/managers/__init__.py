"""Managers own the state of an env beyond the engine: each has one slice of it and the same lifecycle."""
