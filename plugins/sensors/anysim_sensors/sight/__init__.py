"""Sensors that look: what rays from a frame meet, in worlds that declare them."""
