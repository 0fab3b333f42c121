"""Convex pieces of an affordance: shapes with their poses in the frame of the body that they are on."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.geometry.triangles import convex_hull
from anysim.model.world import Box, Capsule, Cylinder, Mesh, MeshShape, Shape, Sphere, World

HULL_VERTICES = 64
"""A hull is sampled on one of at most so many vertices."""


class Hull(NamedTuple):
    """A convex mesh: the corners of its triangles (F, 3, 3) [m], their outward normals (F, 3), and offsets (F,)."""

    corners: Array
    normals: Array
    offsets: Array


class Piece(NamedTuple):
    """A convex shape, its pose (7,) in the body's frame, and for a mesh its hull in the shape's frame."""

    shape: Shape
    pose: Array
    hull: Hull | None = None


def piece_of(world: World, geom: int) -> Piece | None:
    """The piece that a geom is; None for ground, which has no convex volume."""
    one = world.geoms[geom]
    pose = np.array([*one.position, *one.quaternion])
    if isinstance(one.shape, MeshShape):
        if one.shape.concave:
            return None
        return Piece(one.shape, pose, hull_of(next(m for m in world.meshes if m.name == one.shape.mesh)))
    return Piece(one.shape, pose) if isinstance(one.shape, Box | Sphere | Capsule | Cylinder) else None


def hull_of(mesh: Mesh) -> Hull:
    """The convex hull of a mesh."""
    vertices, faces = convex_hull(mesh.vertices, HULL_VERTICES)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    flat = length > 1e-14
    corners, normals = corners[flat], normals[flat] / length[flat, None]
    return Hull(corners, normals, np.einsum("fk,fk->f", normals, corners[:, 0]))


def bounding_radius(piece: Piece) -> float:
    """Of the least ball about the shape's origin that holds it [m]."""
    match piece.shape:
        case Box(half):
            return float(np.linalg.norm(half))
        case Sphere(radius):
            return radius
        case Capsule(radius, half):
            return radius + half
        case Cylinder(radius, half):
            return float(np.hypot(radius, half))
        case _:
            assert piece.hull is not None  # of a mesh; pieces have no other shapes
            return float(np.linalg.norm(piece.hull.corners, axis=-1).max())
