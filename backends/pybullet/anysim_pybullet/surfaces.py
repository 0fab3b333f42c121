"""The pair rules of the conventions, in an engine that multiplies.

A pair's friction is the larger of the two coefficients, or that of the surface of higher priority; Bullet multiplies
the numbers of the two shapes. So each shape gets a number such that the products come out as the rule says: exactly
wherever the rule can be written as products, else as near as least squares come, pairs that matter more first.
"""

import math
from typing import NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.world.model import BodyKind, World
from anysim_pybullet.kernels import compiled
from anysim_pybullet.tree import Tree

_SWEEPS = 100
_APART, _LOOSE, _WITHIN = 1.0, 0.01, 0.001
"""Weights of pairs: of things of different kinds, of two free objects, of links of one robot."""


class Surfaces(NamedTuple):
    """What Bullet gets for each colliding geom (K,)."""

    friction: Array
    spinning: Array
    restitution: Array


class PairRules:
    """The pairs of colliding geoms of a World; gives Bullet's numbers for any coefficients."""

    def __init__(self, world: World, trees: list[Tree], contact_erp: float) -> None:
        self.geoms = np.array([i for i, g in enumerate(world.geoms) if g.collides], dtype=int)
        chosen = [world.geoms[i] for i in self.geoms]
        self.priority = np.array([g.surface.priority for g in chosen], dtype=int)
        self._spin = np.array([g.surface.torsional_friction if g.surface.torsional else 0.0 for g in chosen])
        bounce = np.array([g.surface.restitution for g in chosen], dtype=float)
        tree_of = {WORLD: -1} | {int(b): t.number for t in trees for b in t.bodies}
        self.weight = self._weights(world, [g.body for g in chosen], tree_of, trees)
        # What an impact sinks, up to a step's way, is pushed out with `contact_erp` of its speed, which adds to the
        # bounce: half of that on average.
        wanted = np.maximum(np.maximum.outer(bounce, bounce) - 0.5 * contact_erp, 0.0)
        self._bounce = factors(wanted, self.weight, _SWEEPS) if bounce.any() else np.zeros_like(bounce)

    def _weights(self, world: World, bodies: list[int], tree_of: dict[int, int], trees: list[Tree]) -> Array:
        tree = np.array([tree_of[b] for b in bodies], dtype=int)
        still = np.array([b == WORLD or world.bodies[b].kind is BodyKind.STATIC for b in bodies], dtype=bool)
        single = np.array([t >= 0 and trees[t].free and len(trees[t].bodies) == 1 for t in tree.tolist()], dtype=bool)
        weight = np.where(single[:, None] & single, _LOOSE, _APART)
        weight[tree[:, None] == tree] = _WITHIN
        weight[still[:, None] & still] = 0.0
        body = np.array(bodies, dtype=int)
        weight[body[:, None] == body] = 0.0
        for low, high in world.excluded_pairs:
            weight[np.ix_(body == low, body == high)] = weight[np.ix_(body == high, body == low)] = 0.0
        return weight

    def pair_friction(self, friction: Array) -> Array:
        """(K, K) the friction that each pair should have."""
        above = self.priority[:, None] - self.priority
        return np.where(
            above > 0, friction[:, None], np.where(above < 0, friction, np.maximum.outer(friction, friction))
        )

    def numbers(self, friction: Array) -> Surfaces:
        """What Bullet gets, for coefficients (K,)."""
        if not len(friction):
            return Surfaces(friction, friction, friction)
        wanted = self.pair_friction(friction)
        values = factors(wanted, self.weight, _SWEEPS)
        return Surfaces(values, self._spinning(values), self._bounce)

    def _spinning(self, values: Array) -> Array:
        """Bullet's torsional coefficient of a pair is s1 f2 + s2 f1; that of the rule is the larger of the two."""
        turning = np.flatnonzero(self._spin)
        wanted = np.maximum.outer(self._spin, self._spin)
        spinning = np.zeros_like(values)
        for _ in range(_SWEEPS if len(turning) else 0):
            for i in turning:
                weight = self.weight[i] * values
                below = float(weight @ values)
                if below > 1e-9:
                    spinning[i] = max(0.0, float(weight @ (wanted[i] - spinning * values[i])) / below)
        return spinning

    def error(self, friction: Array) -> float:
        """The largest difference between a pair's friction and the rule, over pairs of different trees."""
        values = self.numbers(friction).friction
        apart = self.weight > _WITHIN
        gap = np.abs(np.multiply.outer(values, values) - self.pair_friction(friction))
        return float(gap[apart].max(initial=0.0))


@compiled
def factors(wanted: Array, weight: Array, sweeps: int) -> Array:
    """Numbers (K,) whose products come nearest to wanted (K, K), by weighted least squares.

    Begins at the solution in logarithms, from where each number in turn takes its best value.
    """
    size = wanted.shape[0]
    logs, floor = np.zeros(size), math.log(0.02)
    for _ in range(sweeps):
        for i in range(size):
            above, below = 0.0, 1e-12
            for j in range(size):
                w = weight[i, j]
                if w == 0.0:
                    continue
                target = max(math.log(max(wanted[i, j], 1e-9)), floor)
                if i == j:
                    above += w * target
                    below += 2.0 * w
                else:
                    above += w * (target - logs[j])
                    below += w
            logs[i] = above / below
    values = np.exp(logs)
    for _ in range(sweeps):
        for i in range(size):
            above, below = 0.0, 1e-12
            for j in range(size):
                if weight[i, j] != 0.0:
                    above += weight[i, j] * values[j] * wanted[i, j]
                    below += weight[i, j] * values[j] * values[j]
            if below > 1e-9:
                values[i] = above / below
    return values
