"""Finding places: collision checks, the search for a place for everything, packing, and the repair of proposals."""
