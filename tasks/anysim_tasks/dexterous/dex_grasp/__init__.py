"""Close a hand with four fingers around a bottle and lift it."""
