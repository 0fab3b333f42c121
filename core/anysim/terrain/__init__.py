"""The ground: where its heights come from, and what they are below a point or a rectangle."""
