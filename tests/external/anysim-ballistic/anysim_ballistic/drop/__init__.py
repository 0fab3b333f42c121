"""A task in which a free flyer falls, pushed by gusts."""
