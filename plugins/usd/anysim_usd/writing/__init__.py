"""Worlds and robots of anysim, written as USD files."""
