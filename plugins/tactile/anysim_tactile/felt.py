"""Contacts that a sensor feels: those of its body that are at its taxels, in the sensor's axes."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.math import pose as P
from anysim_tactile.surfaces import Surface


class Felt(NamedTuple):
    """C contact points of n envs.

    Attributes:
        row: (C,) int, which of the envs.
        position: (C, 3) [m] in the sensor's frame.
        depth: (C,) [m], positive in penetration.
        wrench: (n, 6) force [N] and moment about the frame's origin [N m] on the body, in its axes.
        pushes: (n, 6) the part of it that presses along the normals of the nearest taxels.
    """

    row: Array
    position: Array
    depth: Array
    wrench: Array
    pushes: Array


def felt(engine: SimEngine, env_ids: Array, body: int, frames: Array, surface: Surface, reach: float) -> Felt:
    """What the engine's contact points do to a body within a reach [m] of the taxels, seen from frames (n, 7)."""
    found = engine.contacts(env_ids)
    mine = np.flatnonzero((found.body_a == body) | (found.body_b == body))
    sign = (found.body_b[mine] == body).astype(float) - (found.body_a[mine] == body)
    place = np.zeros(engine.num_envs, dtype=int)
    place[env_ids] = np.arange(len(env_ids))
    row = place[found.env[mine]]
    position = P.rotate_inverse(frames[row, 3:], found.position[mine] - frames[row, :3])
    force = P.rotate_inverse(frames[row, 3:], sign[:, None] * found.force[mine])
    apart = ((position[:, None] - surface.points[None]) ** 2).sum(axis=2)
    near = apart.argmin(axis=1) if len(mine) else np.zeros(0, dtype=int)
    here = apart[np.arange(len(mine)), near] <= reach**2
    row, position, force, near = row[here], position[here], force[here], near[here]
    inward = -surface.normals[near]
    push = np.maximum(P.dot(force, inward), 0.0)[:, None] * inward
    rows = len(env_ids)
    return Felt(
        row, position, found.depth[mine][here], _summed(row, position, force, rows), _summed(row, position, push, rows)
    )


def bumps(points: Felt, surface: Surface, blunt: float) -> Array:
    """Gaps (n, T) [m] to balls of a radius [m] that stand for the contact points; inf where an env has none."""
    gap = np.full((len(points.wrench), len(surface.points)), np.inf)
    apart = ((points.position[:, None] - surface.points[None]) ** 2).sum(axis=2)
    np.minimum.at(gap, points.row, apart / (2 * blunt) - points.depth[:, None])
    return gap


def _summed(row: Array, position: Array, force: Array, rows: int) -> Array:
    """(n, 6) sums of forces, and of their moments about the origin."""
    total = np.zeros((rows, 6))
    np.add.at(total, row, np.concatenate([force, P.cross(position, force)], axis=1))
    return total
