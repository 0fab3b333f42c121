"""Qualification: whether a robot of the catalogue is what it says it is, on one engine, through the whole stack."""
