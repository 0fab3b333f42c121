"""Find a view of a thing that another one hides."""
