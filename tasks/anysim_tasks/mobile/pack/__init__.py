"""Three things from a counter into a crate on a stand beside it."""
