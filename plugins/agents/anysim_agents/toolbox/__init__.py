"""Tools by concern: each is a function of a workspace and its arguments."""
