"""The contract of families."""
