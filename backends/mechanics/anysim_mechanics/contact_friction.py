"""Friction of touching pairs from the balance of momentum, and what contact sensors and contact points make of it.

For libraries that report normal forces alone (PhysX): each touching body's net contact force is known (see
`momentum_balance`), and what its normal forces leave of it is the friction of its pairs. Where a body touches one thing
more than there are such equations (a box on two tables), they say no more than the sum; it is shared among the pairs as
the most likely one, with each pair's friction spread up to its coefficient times its normal force.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.model.pairs import concerned
from anysim.model.world import World
from anysim_mechanics.momentum_balance import Balance

_NOISE = 1e-3
"""Relative, of a momentum equation: single precision, and the terms of a link's that are first-order in the step."""

_EYE = np.eye(3)


class Pair(NamedTuple):
    """Two shapes that touch at P points: forces are on the first body [N].

    Attributes:
        normals: (P, 3) unit, from the second to the first. pressure: (P,) [N] along them.
        position: (P, 3) [m]. separation: (P,) [m]. friction: (3,) [N].
    """

    first: int
    second: int
    normals: Array
    pressure: Array
    position: Array
    separation: Array
    friction: Array

    @property
    def force(self) -> Array:
        """(3,) [N] on the first body."""
        return self.pressure @ self.normals + self.friction

    def shared(self) -> Array:
        """(P, 3) [N] on the first body, friction shared as the pressure is."""
        total = self.pressure.sum()
        share = self.pressure / total if total > 0 else self.pressure
        return self.pressure[:, None] * self.normals + share[:, None] * self.friction


def with_friction(pairs: Sequence[Pair], coefficients: Sequence[float], balance: Balance) -> list[Pair]:
    """Pairs with the friction that their coefficients and the net contact forces on their bodies make likely."""
    spread: list[Array] = []
    for (_, _, normals, pressure, *_), coefficient in zip(pairs, coefficients, strict=True):
        total = pressure.sum()
        across = _EYE * total - np.einsum("p,pi,pj->ij", pressure, normals, normals)
        spread.append(coefficient**2 * total * across)
    friction = _friction(pairs, spread, balance)
    return [pair._replace(friction=f) for pair, f in zip(pairs, friction, strict=True)]


def _friction(pairs: Sequence[Pair], spread: list[Array], balance: Balance) -> Array:
    """(C, 3) [N] on the first bodies: the likeliest with which the momentum of the bodies comes out.

    Args:
        pairs: with their normal forces.
        spread: (3, 3) of each, the covariance of a friction that may be anything its pair could exert.
        balance: net contact forces, and by how much they may be off.
    """
    touched = {body for pair in pairs if pair.pressure.any() for body in (pair.first, pair.second)}
    known = sorted(body for body in touched if body != WORLD and np.isfinite(balance.doubt[body]))
    if not known:
        return np.zeros((len(pairs), 3))
    rows, left = {body: i for i, body in enumerate(known)}, balance.force[known]
    enters = np.zeros((len(rows), len(pairs)))
    for column, pair in enumerate(pairs):
        for body, sign in ((pair.first, 1.0), (pair.second, -1.0)):
            if body in rows:
                enters[rows[body], column] += sign
                left[rows[body]] -= sign * (pair.pressure @ pair.normals)
    free = np.array(spread)
    matrix = np.einsum("ac,cij,bc->aibj", enters, free, enters).reshape(3 * len(rows), -1)
    diagonal = np.einsum("ac,cii->a", np.abs(enters), free).repeat(3)
    matrix[np.diag_indices(len(matrix))] += _NOISE**2 * diagonal + (balance.doubt[known] ** 2).repeat(3) + 1e-18
    weight = np.linalg.solve(matrix, left.ravel()).reshape(-1, 3)
    return np.einsum("cij,ac,aj->ci", free, enters, weight)


def sensor_forces(world: World, pairs: Sequence[Pair]) -> Array:
    """(S, 3) [N]: the net contact force of these pairs on each contact sensor's bodies."""
    total = np.zeros((len(world.contact_sensors), 3))
    pairs = [pair for pair in pairs if pair.pressure.any()]
    first, second = np.array([(pair.first, pair.second) for pair in pairs], dtype=int).reshape(-1, 2).T
    forces = [pair.force for pair in pairs]
    for place, on_first, on_second in concerned(world.contact_sensors, first, second):
        for force, adds, takes in zip(forces, on_first.tolist(), on_second.tolist(), strict=True):
            if adds:
                total[place] += force
            if takes:
                total[place] -= force
    return total


def contact_points(pairs: Sequence[Pair]) -> list[tuple[Array, ...]]:
    """All points that touch or exert force, as columns of `ContactPoints` for each pair."""
    parts: list[tuple[Array, ...]] = []
    for pair in pairs:
        counts = (pair.separation <= 0) | (pair.pressure != 0)
        bodies = np.full(counts.sum(), pair.first), np.full(counts.sum(), pair.second)
        rows = pair.position, -pair.normals, -pair.shared(), -pair.separation
        parts.append((*bodies, *(row[counts] for row in rows)))
    return parts
