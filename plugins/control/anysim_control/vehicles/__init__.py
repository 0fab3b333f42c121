"""Controllers of vehicles."""
