"""Contacts and ray hits in the names of the neutral model."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.state import ContactPoints, RayHits
from anysim.model.pairs import counted
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
    for row, sensor in enumerate(world.contact_sensors):
        for counts, sign in zip(counted(sensor, a, b), (1.0, -1.0), strict=True):
            forces[row] += sign * on_a[counts].sum(axis=0)
    return forces


def contact_points(envs: Sequence[Env], ids: Array) -> ContactPoints:
    """All contact points of envs."""
    parts = []
    for index in ids.tolist():
        points = [c for c in _points(envs[index]) if c[DISTANCE] <= 0.0 or c[FORCE] != 0.0]
        a, b = _bodies(envs[index], points)
        place = np.array([c[POINT] for c in points], dtype=float).reshape(-1, 3)
        normal = -np.array([c[NORMAL] for c in points], dtype=float).reshape(-1, 3)
        depth = -np.array([c[DISTANCE] for c in points], dtype=float)
        parts.append((np.full(len(points), index), a, b, place, normal, -_vectors(points), depth))
    return ContactPoints.joined(parts)


def raycast(world: World, envs: Sequence[Env], origins: Array, directions: Array, ids: Array) -> RayHits:
    """First hits of rays (E, R, 3)."""
    entity_of = {WORLD: 0} | {b: e + 1 for b, e in enumerate(world.body_entity)}
    distance = np.full(origins.shape[:2], np.inf)
    entity = np.full(origins.shape[:2], -1, dtype=int)
    for row, index in enumerate(ids.tolist()):
        left = np.arange(origins.shape[1])
        for reach in REACHES:
            for begin in range(0, len(left), _BATCH):
                some = left[begin : begin + _BATCH]
                start, along = origins[row, some], directions[row, some]
                for k, hit in zip(some.tolist(), _cast(envs[index], start, start + reach * along), strict=True):
                    if hit[0] >= 0:
                        distance[row, k] = hit[2] * reach
                        entity[row, k] = entity_of[envs[index].body_of[hit[0]][hit[1]]]
            left = left[entity[row, left] < 0]
            if not len(left):
                break
    return RayHits(distance, entity)


def _cast(env: Env, start: Array, end: Array) -> Any:
    return bullet().rayTestBatch(start.tolist(), end.tolist(), numThreads=1, physicsClientId=env.id)
