"""The checks of the repository that no ready-made tool makes. One module a concern, each with `check(tree)`."""
