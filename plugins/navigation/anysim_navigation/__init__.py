"""Navigation: where bases can go, ways through rooms, and local planning around what moves."""
