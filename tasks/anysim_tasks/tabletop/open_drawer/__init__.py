"""Pull the top drawer of a cabinet open by its handle."""
