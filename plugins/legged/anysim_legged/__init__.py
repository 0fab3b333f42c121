"""Gaits and balance for anysim: a trot for quadrupeds, standing, squatting, reaching and walking for humanoids."""
