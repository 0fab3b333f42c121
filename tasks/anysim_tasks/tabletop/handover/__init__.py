"""Pass a bar from one arm to another."""
