"""Walk to a stand, take a box from it and lift it, on legs."""
