"""Read-back of the compiled model, for an audit against the World."""

from math import pi
from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim_mujoco.layout import Layout

UNLIMITED = 1e10
"""Stands for infinity where MuJoCo wants a number: the open side of a limit."""


def joint_limits(model: Any, layout: Layout) -> Array:
    """(J, 2) [rad, m] as MuJoCo enforces them, infinite where it does not."""
    joints = model.dof_jntid[layout.joint_v]
    limits = np.where(model.jnt_limited[joints, None].astype(bool), model.jnt_range[joints], [-np.inf, np.inf])
    return np.where(np.abs(limits) >= UNLIMITED, np.copysign(np.inf, limits), limits)


def geom_volumes(model: Any, layout: Layout) -> Array:
    """(G,) [m^3] of colliding geoms; 0 for others, for planes and for height fields."""
    return np.array([_volume(model, geom) if model.geom_contype[geom] else 0.0 for geom in layout.geoms])


def _volume(model: Any, geom: int) -> float:
    kinds = mujoco.mjtGeom
    a, b, c = (float(s) for s in model.geom_size[geom])
    match model.geom_type[geom]:
        case kinds.mjGEOM_BOX:
            return 8 * a * b * c
        case kinds.mjGEOM_SPHERE:
            return 4 / 3 * pi * a**3
        case kinds.mjGEOM_CYLINDER:
            return 2 * pi * a**2 * b
        case kinds.mjGEOM_CAPSULE:
            return 2 * pi * a**2 * b + 4 / 3 * pi * a**3
        case kinds.mjGEOM_MESH:
            return _mesh_volume(model, int(model.geom_dataid[geom]))
        case _:
            return 0.0


def _mesh_volume(model: Any, mesh: int) -> float:
    """Enclosed by the triangles, summed over the tetrahedra that they make with the origin."""
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    vertices = np.asarray(model.mesh_vert[first : first + count], dtype=float)
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    corners = vertices[model.mesh_face[first : first + count]]
    return float(np.linalg.det(corners).sum() / 6)
