"""Checks of states that come from files or from other programs, before anything of them is written."""
