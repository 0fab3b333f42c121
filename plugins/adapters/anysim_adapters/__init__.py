"""Adapters by which clients of other projects attach to anysim unchanged."""
