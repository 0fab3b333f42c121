"""Pairs of bodies that never collide, as PhysX filter words.

Two shapes are kept apart where their groups have the same number and a bit in common. Bodies that hang together by
exclusions get one number; within it each bit stands for a set of bodies of which no two collide.
"""

from collections.abc import Iterable
from typing import NamedTuple

from anysim.errors import EngineError
from anysim.world.model import World

BITS, NUMBERS = 32, 1 << 16


class Group(NamedTuple):
    """The third and fourth filter word of a body's shapes."""

    bits: int = 0
    number: int = 0


def groups_of(world: World) -> dict[int, Group]:
    """The groups of the bodies that take part in an exclusion.

    Raises:
        EngineError: the exclusions of one robot need more sets than there are bits.
    """
    wanted = {frozenset(pair) for pair in world.excluded_pairs}
    # a parent and its child never collide anyhow: such a pair may be covered or not
    harmless = {frozenset((i, b.parent)) for i, b in enumerate(world.bodies) if b.parent >= 0}
    groups: dict[int, Group] = {}
    for number, members in enumerate(_components(wanted), start=1):
        edges = {pair for pair in wanted if pair <= members}
        sets = _cover(edges, edges | {pair for pair in harmless if pair <= members})
        if len(sets) > BITS or number >= NUMBERS:
            names = ", ".join(world.bodies[i].name for i in sorted(members)[:4])
            raise EngineError(
                f"PhysX cannot keep apart the excluded pairs around {names}: they form {len(sets)} sets and there are "
                f"{BITS} bits; exclude all pairs of this robot, or fewer"
            )
        for body in members:
            groups[body] = Group(sum(1 << i for i, part in enumerate(sets) if body in part), number)
    return groups


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
