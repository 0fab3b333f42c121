"""A ledger of episodes for anysim."""
