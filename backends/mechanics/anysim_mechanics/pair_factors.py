"""The pair rules of the conventions, for a library that multiplies.

A pair's friction is the larger of the two coefficients, or that of the surface of higher priority; such a library
(Bullet) multiplies the numbers of the two shapes. So each shape gets a number such that the products come out as the
rule says. Where no such numbers exist (0.2 and 0.2 on a ground of 0.8), a geom becomes one shape for each value that
its pairs can have; shapes meet only in the value of their pair, and each has its root. Coefficients that are changed
later may ask for values that no shape is there for: then the products come as near as least squares bring them.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.math import pose as P
from anysim.math.compiled import compiled
from anysim.model.pairs import may_meet, pair_friction, pair_restitution
from anysim.model.world import Geom, World
from anysim_mechanics.trees import Tree

_SWEEPS = 100
EXACT = 0.02
"""By how much a coefficient may be off before geoms get several shapes, which cost time (a third, for a Panda)."""

_APART, _LOOSE, _WITHIN = 1.0, 0.01, 0.001
"""Weights of pairs: of things of different kinds, of two free objects, of links of one robot."""


class Surfaces(NamedTuple):
    """What the library is given for each shape (K,)."""

    friction: Array
    spinning: Array
    restitution: Array


class PairRules:
    """The pairs of shapes of a World; gives the library's numbers for any coefficients.

    Attributes:
        geoms: (K,) the World's geom of each shape, in order; more than once where a geom has several shapes.
        weight: (K, K) how much a pair counts; 0 where two shapes never meet.
    """

    def __init__(self, world: World, trees: list[Tree], contact_erp: float) -> None:
        """`contact_erp` is the share of a penetration that the library takes back in a step."""
        self._world, self._erp = world, contact_erp
        solid = np.array([i for i, g in enumerate(world.geoms) if g.collides], dtype=int)
        tree_of = {WORLD: -1} | {int(b): t.number for t in trees for b in t.bodies}
        self._take(solid, self._weights(world, [world.geoms[i].body for i in solid], tree_of, trees))
        friction = np.array([world.geoms[i].surface.friction for i in solid], dtype=float)
        bounce = np.array([world.geoms[i].surface.restitution for i in solid], dtype=float)
        if self._gap(friction, bounce) > EXACT:
            self._split(friction, bounce)

    def _take(self, geoms: Array, weight: Array) -> None:
        surfaces = [self._world.geoms[i].surface for i in geoms]
        self.geoms, self.weight = geoms, weight
        self.priority = np.array([s.priority for s in surfaces], dtype=int)
        self._spin = np.array([s.torsional_friction if s.torsional else 0.0 for s in surfaces])
        self._numbers = lru_cache(maxsize=64)(self._make_numbers)

    def _gap(self, friction: Array, restitution: Array) -> float:
        """The largest difference between a coefficient of a pair and the rule's."""
        meet, found = self.weight > 0, self.numbers(friction, restitution)
        slide = np.abs(np.multiply.outer(found.friction, found.friction) - self.pair_friction(friction))
        bounce = np.multiply.outer(found.restitution, found.restitution) - self.pair_restitution(restitution)
        return float(max(slide[meet].max(initial=0.0), np.abs(bounce)[meet].max(initial=0.0)))

    def _split(self, friction: Array, restitution: Array) -> None:
        """Give each geom a shape for each pair of values, of friction and of restitution, that it can meet with."""
        wanted = [self.pair_friction(friction), self.pair_restitution(restitution)]
        shapes: list[tuple[int, tuple[float, ...]]] = []
        for i in range(len(self.geoms)):
            values = {tuple(float(w[i, k]) for w in wanted) for k in np.flatnonzero(self.weight[i])}
            shapes += [(i, value) for value in sorted(values)] or [(i, ())]
        weight = np.zeros((len(shapes), len(shapes)))
        for row, (i, value) in enumerate(shapes):
            for column, (k, other) in enumerate(shapes):
                if value == other and self.weight[i, k] > 0 and value == tuple(float(w[i, k]) for w in wanted):
                    weight[row, column] = self.weight[i, k]
        self._take(self.geoms[[i for i, _ in shapes]], weight)

    def _weights(self, world: World, bodies: list[int], tree_of: dict[int, int], trees: list[Tree]) -> Array:
        tree = np.array([tree_of[b] for b in bodies], dtype=int)
        single = np.array([t >= 0 and trees[t].free and len(trees[t].bodies) == 1 for t in tree.tolist()], dtype=bool)
        weight = np.where(single[:, None] & single, _LOOSE, _APART)
        weight[tree[:, None] == tree] = _WITHIN
        return np.where(may_meet(world, np.array(bodies, dtype=int)), weight, 0.0)

    def pair_friction(self, friction: Array) -> Array:
        """(K, K) the friction that each pair should have."""
        return pair_friction(friction, self.priority)

    def pair_restitution(self, restitution: Array) -> Array:
        """(K, K) the restitution that each pair should be given."""
        # What an impact sinks, up to a step's way, is pushed out with `contact_erp` of its speed, which adds to the
        # bounce: half of that on average.
        return np.maximum(pair_restitution(restitution) - 0.5 * self._erp, 0.0)

    def numbers(self, friction: Array, restitution: Array, shapes: Array | None = None) -> Surfaces:
        """The numbers for coefficients (K,) of all shapes' geoms, for those shapes that are there (None: all)."""
        chosen = np.arange(len(friction)) if shapes is None else shapes
        return self._numbers(friction.tobytes(), restitution.tobytes(), chosen.tobytes())

    def _make_numbers(self, frictions: bytes, restitutions: bytes, chosen: bytes) -> Surfaces:
        friction, restitution = np.frombuffer(frictions), np.frombuffer(restitutions)
        shapes = np.frombuffer(chosen, dtype=np.int64)
        if not len(shapes):
            return Surfaces(*([np.zeros(0)] * 3))
        pairs = np.ix_(shapes, shapes)
        weight = np.ascontiguousarray(self.weight[pairs])
        values = factors(np.ascontiguousarray(self.pair_friction(friction)[pairs]), weight, _SWEEPS)
        bounce = np.zeros(len(shapes))
        if restitution.any():
            wanted = np.ascontiguousarray(self.pair_restitution(restitution)[pairs])
            bounce = factors(wanted, weight, _SWEEPS)
        return Surfaces(values, self._spinning(values, weight, self._spin[shapes]), bounce)

    @staticmethod
    def _spinning(values: Array, weights: Array, spin: Array) -> Array:
        """A torsional coefficient of a pair is s1 f2 + s2 f1 in Bullet; that of the rule is the larger of the two."""
        turning = np.flatnonzero(spin)
        wanted = np.maximum.outer(spin, spin)
        spinning = np.zeros_like(values)
        for _ in range(_SWEEPS if len(turning) else 0):
            for i in turning:
                weight = weights[i] * values
                below = float(P.dot(weight, values))
                if below > 1e-9:
                    spinning[i] = max(0.0, float(P.dot(weight, wanted[i] - spinning * values[i])) / below)
        return spinning

    def shapes_on(self, bodies: Array) -> dict[int, list[tuple[int, Geom]]]:
        """The shapes of each body: their numbers and geoms."""
        wanted: dict[int, list[tuple[int, Geom]]] = {int(b): [] for b in bodies}
        for number, index in enumerate(self.geoms.tolist()):
            geom = self._world.geoms[index]
            if geom.body in wanted:
                wanted[geom.body].append((number, geom))
        return wanted


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
