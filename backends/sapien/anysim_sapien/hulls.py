"""Convex hulls as PhysX has them."""

from functools import lru_cache
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.kinematics import inertia
from anysim.model.world import Mesh, MeshShape
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
    if _loses(corners.tobytes(), np.asarray(mesh.faces, dtype=np.int32).tobytes()):
        return physx.PhysxCollisionShapeConvexMesh(FINER * corners, [1.0 / FINER] * 3, material)
    return physx.PhysxCollisionShapeConvexMesh(corners, UNIT_SCALE, material)


@lru_cache(maxsize=4096)
def _loses(corners: bytes, faces: bytes) -> bool:
    """Whether a hull of (V, 3) float32 and (F, 3) int32 loses more than allowed; asked once, however many envs."""
    vertices = np.frombuffer(corners, dtype=np.float32).reshape(-1, 3)
    mesh = Mesh("hull", vertices.astype(float), np.frombuffer(faces, dtype=np.int32).reshape(-1, 3))
    whole = inertia.volume(MeshShape(mesh.name), {mesh.name: mesh})
    cooked = physx.PhysxCollisionShapeConvexMesh(vertices, UNIT_SCALE, physx.PhysxMaterial(0.0, 0.0, 0.0))
    return abs(volume(cooked) - whole) > AUDIT_ALLOWANCES["volume"].relative * whole


def volume(shape: Any) -> float:
    """[m^3] of a cooked hull, by its own corners and triangles."""
    corners: Array = np.asarray(shape.vertices, dtype=float) * np.asarray(shape.scale, dtype=float)
    return abs(float(np.linalg.det(corners[np.asarray(shape.triangles)]).sum() / 6))
