"""Four things of different shapes into a bin."""
