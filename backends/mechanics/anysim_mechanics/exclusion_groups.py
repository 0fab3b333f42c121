"""Pairs of bodies that never collide, as filter words such as those of PhysX in SAPIEN.

Two shapes are kept apart where their groups have the same number and a bit in common. Bodies that hang together by
exclusions get one number; within it each bit stands for a set of bodies of which no two collide. -1 is the world.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.errors import EngineError
from anysim.model.world import World

BITS, NUMBERS = 32, 1 << 16


class Group(NamedTuple):
    """The filter words of a body's shapes."""

    bits: int = 0
    number: int = 0


class Apart(NamedTuple):
    """How the excluded pairs are kept apart.

    Attributes:
        groups: filter words of the bodies that need some.
        labels: bodies that `collision_groups` keeps apart, where filter words do not suffice; equal ones are alike.
        between: pairs of labels (both ways) whose bodies never collide.
    """

    groups: dict[int, Group]
    labels: dict[int, int]
    between: frozenset[tuple[int, int]]


def apart_of(world: World, there: Array | None = None) -> Apart:
    """The World's exclusions, or those between bodies (B,) that are there.

    Bodies that many others pass through need many sets, a tool with 20 links against two parts 40 of them. There the
    pairs across entities are left to the collision groups that surfaces have: these take a bit for each kind of body.

    Raises:
        EngineError: the exclusions within one entity need more sets than there are bits.
    """
    here = np.ones(len(world.bodies), dtype=bool) if there is None else there
    wanted = {frozenset(pair) for pair in world.excluded_pairs if all(b == WORLD or here[b] for b in pair)}
    entity = {WORLD: WORLD} | dict(enumerate(world.body_entity))
    across: set[frozenset[int]] = set()
    for members in _components(wanted):
        edges = {pair for pair in wanted if pair <= members}
        if len(_sets(world, edges, members)) > BITS:
            across |= {pair for pair in edges if len({entity[body] for body in pair}) > 1}
    labels, between = _labels(across)
    return Apart(groups_of(world, wanted - across), labels, between)


def groups_of(world: World, wanted: set[frozenset[int]]) -> dict[int, Group]:
    """The groups of the bodies that take part in an exclusion."""
    groups: dict[int, Group] = {}
    for number, members in enumerate(_components(wanted), start=1):
        sets = _sets(world, {pair for pair in wanted if pair <= members}, members)
        if len(sets) > BITS or number >= NUMBERS:
            names = ", ".join(world.bodies[i].name for i in sorted(members) if i != WORLD)
            raise EngineError(
                f"the excluded pairs around {names[:80]} form {len(sets)} sets, more than the {BITS} bits of collision "
                f"groups keep apart; exclude all pairs of this robot, or fewer"
            )
        for body in members:
            groups[body] = Group(sum(1 << i for i, part in enumerate(sets) if body in part), number)
    return groups


def _labels(pairs: set[frozenset[int]]) -> tuple[dict[int, int], frozenset[tuple[int, int]]]:
    """Bodies with the same partners get the same label; two labels collide all or not at all."""
    partners: dict[int, set[int]] = {}
    for first, second in (sorted(pair) for pair in pairs):
        partners.setdefault(first, set()).add(second)
        partners.setdefault(second, set()).add(first)
    numbers: dict[frozenset[int], int] = {}
    labels = {body: numbers.setdefault(frozenset(partners[body]), len(numbers) + 1) for body in sorted(partners)}
    return labels, frozenset((labels[a], labels[b]) for pair in pairs for a in pair for b in pair if a != b)


def _sets(world: World, edges: set[frozenset[int]], members: frozenset[int]) -> list[frozenset[int]]:
    # a parent and its child never collide anyhow: such a pair may be covered or not
    harmless = {frozenset((i, world.bodies[i].parent)) for i in members if i != WORLD and world.bodies[i].parent >= 0}
    return _cover(edges, edges | {pair for pair in harmless if pair <= members})


def _components(pairs: Iterable[frozenset[int]]) -> list[frozenset[int]]:
    parts: list[frozenset[int]] = []
    for pair in sorted(pairs, key=sorted):
        touched = [part for part in parts if part & pair]
        parts = [part for part in parts if not part & pair]
        parts.append(frozenset(pair).union(*touched))
    return sorted(parts, key=min)


def _cover(edges: set[frozenset[int]], allowed: set[frozenset[int]]) -> list[frozenset[int]]:
    """Sets of bodies whose pairs are all allowed and that cover all edges: grown greedily, in a fixed order."""
    bodies = sorted({body for pair in allowed for body in pair})
    near = {body: {other for pair in allowed if body in pair for other in pair if other != body} for body in bodies}
    sets: list[frozenset[int]] = []
    left = sorted(tuple(sorted(pair)) for pair in edges)
    while left:
        grown = set(left[0])
        for body in bodies:
            if body not in grown and grown <= near[body]:
                grown.add(body)
        sets.append(frozenset(grown))
        left = [pair for pair in left if not set(pair) <= grown]
    return sets
