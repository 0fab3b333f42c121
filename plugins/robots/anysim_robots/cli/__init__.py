"""Commands about robots of the catalogue."""
