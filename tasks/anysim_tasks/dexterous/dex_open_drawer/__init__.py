"""Open a drawer with fingers hooked behind the bar of its handle."""
