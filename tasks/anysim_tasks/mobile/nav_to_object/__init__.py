"""Drive up to a named thing in a furnished room, and face it."""
