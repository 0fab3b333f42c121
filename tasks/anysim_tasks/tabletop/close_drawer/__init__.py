"""Push the top drawer of a cabinet shut."""
