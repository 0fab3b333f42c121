"""Mechanics for engines whose library lacks some: the drive law, forces of contacts, pairs that meet by the rules."""
