"""Compiled loops over magnets, puffs and pixels."""
