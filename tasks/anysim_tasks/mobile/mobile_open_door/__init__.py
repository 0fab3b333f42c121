"""Drive to a door and pull it open."""
