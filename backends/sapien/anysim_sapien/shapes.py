"""Geoms as PhysX shapes. Every shape has a material of its own: SAPIEN's default one is shared by all bodies."""

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


def make_shape(world: World, geom: Geom, copy: Copy, group: Group, options: SapienOptions) -> Any:
    """One PhysX shape of a geom.

    Raises:
        EngineError: PhysX cannot make it.
    """
    friction, restitution = copy.touch
    material = physx.PhysxMaterial(friction, friction, restitution)
    try:
        shape = _shape(world, geom, material)
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


def _shape(world: World, geom: Geom, material: Any) -> Any:
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
        case MeshShape(name, concave):
            mesh = next(mesh for mesh in world.meshes if mesh.name == name)
            if concave:
                triangles = np.asarray(mesh.faces, dtype=np.uint32)
                vertices = np.asarray(mesh.vertices, dtype=np.float32)
                return physx.PhysxCollisionShapeTriangleMesh(vertices, triangles, UNIT_SCALE, material)
            return convex(mesh, material)
        case HeightFieldShape(name):
            field = next(field for field in world.heightfields if field.name == name)
            vertices, triangles = relief(field)
            return physx.PhysxCollisionShapeTriangleMesh(vertices, triangles, UNIT_SCALE, material)


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
