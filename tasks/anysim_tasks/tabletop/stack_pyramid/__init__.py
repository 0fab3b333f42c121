"""Two cubes side by side, and a third on top of both."""
