"""Shapes of a World as Rerun's archetypes, in their own frames."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.world import (
    Box,
    Capsule,
    Cylinder,
    HeightField,
    HeightFieldShape,
    MeshShape,
    Plane,
    Shape,
    Sphere,
    World,
)


def drawn(world: World, shape: Shape, color: Array) -> Any:
    """What Rerun draws of a shape, in one colour (4,) of 0 to 1; textures are left out."""
    import rerun as rr  # pyright: ignore[reportMissingImports]

    rgba = [np.round(np.clip(color, 0.0, 1.0) * 255).astype(np.uint8).tolist()]
    solid: dict[str, Any] = {"colors": rgba, "fill_mode": "solid"}
    match shape:
        case Plane(size):
            return rr.Boxes3D(half_sizes=[[size, size, 0.0]], **solid)
        case Box(half):
            return rr.Boxes3D(half_sizes=[half], **solid)
        case Sphere(radius):
            return rr.Ellipsoids3D(radii=[radius], **solid)
        case Capsule(radius, half):
            return rr.Capsules3D(lengths=[2 * half], radii=[radius], translations=[[0.0, 0.0, -half]], **solid)
        case Cylinder(radius, half):
            return rr.Cylinders3D(lengths=[2 * half], radii=[radius], **solid)
        case MeshShape(name):
            mesh = next(one for one in world.meshes if one.name == name)
            vertices, faces = mesh.vertices, mesh.faces
        case HeightFieldShape(name):
            vertices, faces = field_mesh(next(one for one in world.heightfields if one.name == name))
    return rr.Mesh3D(
        vertex_positions=vertices.astype(np.float32),
        triangle_indices=faces.astype(np.uint32),
        vertex_normals=corner_normals(vertices, faces),
        albedo_factor=rgba[0],
    )


def field_mesh(field: HeightField) -> tuple[Array, Array]:
    """Vertices (V, 3) and faces (F, 3) of a height field: two triangles for each of its cells, seen from above."""
    rows, columns = field.heights.shape
    x, y = (np.linspace(-extent / 2, extent / 2, n) for extent, n in zip(field.size, (columns, rows), strict=True))
    across, along = np.meshgrid(x, y)
    vertices = np.stack([across, along, field.heights], axis=-1).reshape(-1, 3)
    low = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, up, far = low + 1, low + columns, low + columns + 1
    return vertices, np.concatenate([np.stack([low, right, far], axis=1), np.stack([low, far, up], axis=1)])


def corner_normals(vertices: Array, faces: Array) -> Array:
    """(V, 3) float32: at each vertex the mean direction of its triangles, by their areas; z where it has none."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    summed = np.zeros_like(vertices, dtype=float)
    for k in range(3):
        np.add.at(summed, faces[:, k], across)
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    return np.where(length > 0, summed / np.maximum(length, 1e-300), [0.0, 0.0, 1.0]).astype(np.float32)
