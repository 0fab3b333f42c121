"""Commands that look at policies."""
