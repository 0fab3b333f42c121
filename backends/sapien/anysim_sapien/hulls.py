"""Convex hulls as PhysX has them."""

from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.world import inertia
from anysim.world.model import Mesh, MeshShape
from anysim_sapien.declared import AUDIT_ALLOWANCES
from anysim_sapien.library import physx

UNIT_SCALE = [1.0, 1.0, 1.0]
FINER = 10.0


def convex(mesh: Mesh, material: Any) -> Any:
    """The shape of a mesh's hull.

    Cooking drops corners within 0.7 mm of the rest, whatever the size of the hull: that is a tenth of a tooth 5 mm
    thick. A hull that would lose more than the audit allows is cooked at ten times its size and scaled back.
    """
    corners = np.asarray(mesh.vertices, dtype=np.float32)
    shape = physx.PhysxCollisionShapeConvexMesh(corners, UNIT_SCALE, material)
    whole = inertia.volume(MeshShape(mesh.name), {mesh.name: mesh})
    if abs(volume(shape) - whole) > AUDIT_ALLOWANCES["volume"].relative * whole:
        shape = physx.PhysxCollisionShapeConvexMesh(FINER * corners, [1.0 / FINER] * 3, material)
    return shape


def volume(shape: Any) -> float:
    """[m^3] of a cooked hull, by its own corners and triangles."""
    corners: Array = np.asarray(shape.vertices, dtype=float) * np.asarray(shape.scale, dtype=float)
    return abs(float(np.linalg.det(corners[np.asarray(shape.triangles)]).sum() / 6))
