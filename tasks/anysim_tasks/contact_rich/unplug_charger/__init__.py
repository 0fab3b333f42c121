"""Pull a charger out of its socket."""
