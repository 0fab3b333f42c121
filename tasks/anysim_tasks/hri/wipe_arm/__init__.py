"""Wipe the forearm of a person with a sponge."""
