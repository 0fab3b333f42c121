"""Solids as Coal, the collision library, has them, for distances between shapes."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.shapes import Box, Capsule, Cylinder, Shape, Sphere


def coal_solid(shape: Shape) -> object | None:
    """A box, ball, capsule or cylinder, in its own frame; None for what is made of triangles, and for ground."""
    import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

    match shape:
        case Box((x, y, z)):
            return coal.Box(2 * x, 2 * y, 2 * z)
        case Sphere(radius):
            return coal.Sphere(radius)
        case Capsule(radius, half_length):
            return coal.Capsule(radius, 2 * half_length)
        case Cylinder(radius, half_length):
            return coal.Cylinder(radius, 2 * half_length)
        case _:
            return None


def coal_hull(vertices: Array) -> Any:
    """The convex hull of vertices (V, 3) [m] that are not all in one plane: what a convex mesh is for the engines."""
    import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

    if len(vertices) < 4:  # Coal would end the process
        raise ValueError(f"a hull needs four points that are not in one plane, got {len(vertices)}")
    points = coal.StdVec_Vec3s()
    points.extend(np.asarray(vertices, dtype=float))
    return coal.Convex.convexHull(points, True, "Qt")


def coal_triangles(vertices: Array, faces: Array) -> Any:
    """A surface of triangles, faces (F, 3) of vertices (V, 3) [m]: ground, or another concave mesh."""
    import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    model.addVertices(np.asarray(vertices, dtype=float))
    model.addTriangles(np.asarray(faces, dtype=np.uint32))
    model.endModel()
    return model
