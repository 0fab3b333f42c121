"""The contract of sensors."""
