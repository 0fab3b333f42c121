"""Collision geometry of meshes: convex pieces, primitives, triangles."""
