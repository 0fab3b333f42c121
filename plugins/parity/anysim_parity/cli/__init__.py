"""Commands that compare engines."""
