"""Fluid, sand and rice: particles with a solver of their own beside any engine."""
