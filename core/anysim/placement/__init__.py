"""Placement: where objects go, nominally and in each episode."""
