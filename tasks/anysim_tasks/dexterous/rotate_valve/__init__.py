"""Turn a valve of bare spokes with a finger."""
