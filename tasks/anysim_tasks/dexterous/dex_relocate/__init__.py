"""Bring a bottle to a point in the air with a hand that has four fingers."""
