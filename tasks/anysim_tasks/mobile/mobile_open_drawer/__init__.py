"""Drive to a cabinet and pull its top drawer open."""
