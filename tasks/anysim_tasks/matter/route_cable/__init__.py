"""Lead a cable around two posts."""
