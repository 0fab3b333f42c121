"""Geoms as PhysX shapes. Every shape has a material of its own: SAPIEN's default one is shared by all bodies."""

from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.world import (
    Box,
    Capsule,
    Cylinder,
    Geom,
    HeightField,
    HeightFieldShape,
    MeshShape,
    Plane,
    Shape,
    Sphere,
    World,
)
from anysim_mechanics.collision_groups import Copy
from anysim_mechanics.exclusion_groups import Group
from anysim_sapien.hulls import UNIT_SCALE, convex
from anysim_sapien.library import physx, sapien
from anysim_sapien.options import SapienOptions

X_TO_Z = np.array([0.0, -sqrt(0.5), 0.0, sqrt(0.5)])
"""PhysX has the normal of a plane and the axis of a capsule or cylinder along x; the World has them along z."""


BOUNCY_OFFSET = 1e-4
"""[m]: at which a contact that bounces is prepared.

PhysX lets nothing cross more than four fifths of a gap in one step. A ball that comes to lie between that and the
surface loses up to a fifth of its speed there and bounces with the rest, so that bounces differ by chance. Prepared
this late, contacts bounce from the full speed.
"""


def to_pose(pose: Array) -> Any:
    """A sapien.Pose of a row [x, y, z, qx, qy, qz, qw]."""
    return sapien.Pose(pose[:3], wxyz_from_xyzw(pose[3:]))


def make_shape(
    world: World, geom: Geom, copy: Copy, group: Group, options: SapienOptions, files: Mapping[str, str]
) -> Any:
    """One PhysX shape of a geom; of large ground from its file, by the geom's name.

    Raises:
        EngineError: PhysX cannot make it.
    """
    friction, restitution = copy.touch
    material = physx.PhysxMaterial(friction, friction, restitution)
    try:
        shape = _shape(world, geom, material, files)
    except RuntimeError as error:
        raise EngineError(f"PhysX cannot make the shape of geom '{geom.name}': {error}") from error
    turn = np.asarray(geom.quaternion, dtype=float)
    if isinstance(geom.shape, Plane | Capsule | Cylinder):
        turn = P.multiply(turn, X_TO_Z)
    shape.set_local_pose(to_pose(np.concatenate([geom.position, turn])))
    shape.set_collision_groups([copy.kind, copy.meets, group.bits, group.number])
    own = geom.surface.contact_offset
    offset = options.contact_offset if own is None else own
    shape.set_contact_offset(BOUNCY_OFFSET if copy.touch.restitution > 0 else offset)
    shape.set_rest_offset(0.0)
    # what resists a turn about the normal is the distance of a contact's points; PhysX' own needs another solver
    shape.set_patch_radius(0.0)
    shape.set_min_patch_radius(0.0)
    return shape


def _shape(world: World, geom: Geom, material: Any, files: Mapping[str, str]) -> Any:
    if geom.name in files:
        return physx.PhysxCollisionShapeTriangleMesh(files[geom.name], UNIT_SCALE, material)
    ground = ground_triangles(world, geom.shape)
    if ground is not None:
        return physx.PhysxCollisionShapeTriangleMesh(*ground, UNIT_SCALE, material)
    match geom.shape:
        case Plane():
            return physx.PhysxCollisionShapePlane(material)
        case Box(half_size):
            return physx.PhysxCollisionShapeBox(list(half_size), material)
        case Sphere(radius):
            return physx.PhysxCollisionShapeSphere(radius, material)
        case Capsule(radius, half_length):
            return physx.PhysxCollisionShapeCapsule(radius, half_length, material)
        case Cylinder(radius, half_length):
            return physx.PhysxCollisionShapeCylinder(radius, half_length, material)
        case MeshShape(name):
            return convex(next(mesh for mesh in world.meshes if mesh.name == name), material)
        case HeightFieldShape():
            raise AssertionError("a height field is ground")


def ground_triangles(world: World, shape: Shape) -> tuple[Array, Array] | None:
    """Vertices (V, 3) float32 and triangles (T, 3) uint32 of a concave mesh or a height field; None of other shapes."""
    match shape:
        case MeshShape(name, concave=True):
            mesh = next(mesh for mesh in world.meshes if mesh.name == name)
            return np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32)
        case HeightFieldShape(name):
            return relief(next(field for field in world.heightfields if field.name == name))
        case _:
            return None


def relief(field: HeightField) -> tuple[Array, Array]:
    """Vertices (V, 3) float32 and triangles (T, 3) uint32 of a height field, counter-clockwise seen from above."""
    heights = np.asarray(field.heights, dtype=np.float32)
    rows, columns = heights.shape
    x = np.linspace(-field.size[0] / 2, field.size[0] / 2, columns, dtype=np.float32)
    y = np.linspace(-field.size[1] / 2, field.size[1] / 2, rows, dtype=np.float32)
    vertices = np.stack([*np.meshgrid(x, y), heights], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1, 1)
    lower = corner + np.array([0, 1, columns + 1])
    upper = corner + np.array([0, columns + 1, columns])
    return vertices, np.concatenate([lower, upper]).astype(np.uint32)
