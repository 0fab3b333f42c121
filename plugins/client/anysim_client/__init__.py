"""Client of services: envs that are stepped elsewhere, and pools of them, with the protocol that both sides speak."""
