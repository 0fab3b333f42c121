"""Contacts and ray hits in the names of the neutral model."""

from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.model.pairs import concerned
from anysim.model.world import World
from anysim_pybullet.bullet import bullet
from anysim_pybullet.client import Env

BODY_A, BODY_B, LINK_A, LINK_B, POINT, NORMAL, DISTANCE, FORCE = 1, 2, 3, 4, 6, 7, 8, 9
FRICTION_1, DIRECTION_1, FRICTION_2, DIRECTION_2 = 10, 11, 12, 13
"""Fields of Bullet's contact points; the normal points from b to a, forces are those on a."""

REACHES = (10.0, 100.0, 10000.0)
"""[m] Bullet's rays are segments and precise to a share of their length: short ones first."""
_BATCH = 8192


def _points(env: Env) -> list[Any]:
    """Bullet's contact points, in an order of their own: a restored state lists the same ones in another."""
    points = bullet().getContactPoints(physicsClientId=env.id) or ()
    return sorted(points, key=lambda c: (c[BODY_A], c[BODY_B], c[LINK_A], c[LINK_B], c[POINT], c[NORMAL], c[FORCE]))


def _vectors(points: Any) -> Array:
    """Forces on a (C, 3) [N] of Bullet's contact points: along the normal and by friction."""
    normal = np.array([c[NORMAL] for c in points], dtype=float).reshape(-1, 3)
    first = np.array([c[DIRECTION_1] for c in points], dtype=float).reshape(-1, 3)
    second = np.array([c[DIRECTION_2] for c in points], dtype=float).reshape(-1, 3)
    size = np.array([(c[FORCE], c[FRICTION_1], c[FRICTION_2]) for c in points], dtype=float).reshape(-1, 3)
    return size[:, :1] * normal + size[:, 1:2] * first + size[:, 2:] * second


def _bodies(env: Env, points: Any) -> tuple[Array, Array]:
    table = env.body_of
    a = np.array([table[c[BODY_A]][c[LINK_A]] for c in points], dtype=int)
    b = np.array([table[c[BODY_B]][c[LINK_B]] for c in points], dtype=int)
    return a, b


def sensor_forces(world: World, env: Env) -> Array:
    """(S, 3) [N] of an env's contact sensors in the last step."""
    forces = np.zeros((len(world.contact_sensors), 3))
    if not world.contact_sensors:
        return forces
    points = [c for c in _points(env) if c[FORCE] != 0.0]
    if not points:
        return forces
    on_a, (a, b) = _vectors(points), _bodies(env, points)
    for row, on_first, on_second in concerned(world.contact_sensors, a, b):
        for counts, sign in ((on_first, 1.0), (on_second, -1.0)):
            forces[row] += sign * on_a[counts].sum(axis=0)
    return forces


def contact_points(env: Env) -> tuple[Array, ...]:
    """All contact points of an env, as columns of `ContactPoints`."""
    points = [c for c in _points(env) if c[DISTANCE] <= 0.0 or c[FORCE] != 0.0]
    place = np.array([c[POINT] for c in points], dtype=float).reshape(-1, 3)
    normal = -np.array([c[NORMAL] for c in points], dtype=float).reshape(-1, 3)
    depth = -np.array([c[DISTANCE] for c in points], dtype=float)
    return (*_bodies(env, points), place, normal, -_vectors(points), depth)


def raycast(env: Env, origins: Array, directions: Array) -> tuple[Array, Array]:
    """First hits of rays (R, 3): distances, and bodies."""
    distance, body = np.full(len(origins), np.inf), np.full(len(origins), WORLD)
    left = np.arange(len(origins))
    for reach in REACHES:
        for some in np.split(left, range(_BATCH, len(left), _BATCH)):
            start, end = origins[some], origins[some] + reach * directions[some]
            hits = bullet().rayTestBatch(start.tolist(), end.tolist(), numThreads=1, physicsClientId=env.id)
            for k, hit in zip(some.tolist(), hits, strict=True):
                if hit[0] >= 0:
                    distance[k], body[k] = hit[2] * reach, env.body_of[hit[0]][hit[1]]
        left = left[np.isinf(distance[left])]
        if not len(left):
            break
    return distance, body
