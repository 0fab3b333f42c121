"""Worker processes that each hold an engine for a block of envs, and what the parent shares with them."""
