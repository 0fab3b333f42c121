"""Read-back of an env from Bullet, for an audit against the World."""

from collections.abc import Sequence
from math import pi

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.shapes import MeshShape, is_ground
from anysim_pybullet.bullet import MOST_CLIENTS, bullet
from anysim_pybullet.client import Env
from anysim_pybullet.urdf import UNLIMITED


def handles(envs: Sequence[Env]) -> dict[str, int]:
    """Open clients of the process, and what the clients of some envs hold."""
    p = bullet()
    return {
        "clients": sum(bool(p.isConnected(physicsClientId=number)) for number in range(MOST_CLIENTS)),
        "bodies": sum(p.getNumBodies(physicsClientId=env.id) for env in envs),
        "constraints": sum(p.getNumConstraints(physicsClientId=env.id) for env in envs),
    }


def read_back(env: Env) -> dict[str, Array]:
    """Joint limits, volumes, masses, centres of mass and inertias as Bullet has them."""
    return {"joint.limits": _joint_limits(env), "geom.volume": _geom_volumes(env), **_inertials(env)}


def _joint_limits(env: Env) -> Array:
    """(J, 2) [rad, m] as Bullet enforces them, infinite where it does not, not a number for what is not there."""
    limits = np.full((len(env.joint_link), 2), np.nan)
    for j in env.cast.joints.tolist():
        link = env.joint_link[j]
        uid = env.body_at[env.plan.world.joints[j].body][0]
        lower, upper = bullet().getJointInfo(uid, link, physicsClientId=env.id)[8:10]
        limits[j] = (lower, upper) if lower <= upper else (-np.inf, np.inf)
    return np.where(np.abs(limits) >= UNLIMITED, np.copysign(np.inf, limits), limits)


def _inertials(env: Env) -> dict[str, Array]:
    """Masses (B,), centres of mass (B, 3) in the bodies' frames, and inertias (B, 6) in their axes; 0 of the absent."""
    count = len(env.body_at)
    mass, com, inertia = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 6))
    for i in np.flatnonzero(env.cast.bodies).tolist():
        uid, link = env.body_at[i]
        info = bullet().getDynamicsInfo(uid, link, physicsClientId=env.id)
        axes = P.to_matrix(np.array(info[4]))
        tensor = axes @ np.diag(info[2]) @ axes.T
        mass[i], com[i] = info[0], np.array(info[3]) + env.plan.frames.anchor[i]
        inertia[i] = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return {"body.mass": mass, "body.com": com, "body.inertia": inertia}


def _geom_volumes(env: Env) -> Array:
    """(G,) [m^3] of colliding geoms; 0 for others, for planes and for height fields."""
    volumes = np.zeros(len(env.plan.world.geoms))
    for number, (uid, link) in env.shape_at.items():
        index = int(env.plan.rules.geoms[number])
        shape = env.plan.world.geoms[index].shape
        if is_ground(shape) or (isinstance(shape, MeshShape) and shape.concave):
            continue
        for shape in bullet().getCollisionShapeData(uid, link, physicsClientId=env.id):
            volumes[index] = _volume(shape[2], shape[3], env, uid, link)
    return volumes


def _volume(kind: int, size: tuple[float, ...], env: Env, uid: int, link: int) -> float:
    """Bullet gives a box by its edges, a ball by its radius, cylinders and capsules by length and radius."""
    p = bullet()
    if kind == p.GEOM_BOX:
        return size[0] * size[1] * size[2]
    if kind == p.GEOM_SPHERE:
        return 4 / 3 * pi * size[0] ** 3
    if kind == p.GEOM_CYLINDER:
        return pi * size[1] ** 2 * size[0]
    if kind == p.GEOM_CAPSULE:
        return pi * size[1] ** 2 * size[0] + 4 / 3 * pi * size[1] ** 3
    if kind == p.GEOM_MESH:
        from scipy.spatial import ConvexHull

        _, corners = p.getMeshData(uid, link, physicsClientId=env.id)
        return float(ConvexHull(np.array(corners)).volume)
    return 0.0
