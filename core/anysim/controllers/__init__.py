"""Controllers: how an action of a channel becomes targets of its drives."""
