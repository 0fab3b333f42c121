"""Drive to a cart, take hold of its bar and push it to a goal."""
