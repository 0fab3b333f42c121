"""Shapes of the neutral model: bounds, convex parts, hulls, triangles and polygons."""
