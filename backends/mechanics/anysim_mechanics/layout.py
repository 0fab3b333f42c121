"""Articulations and single bodies of a World, or of what is there of it: indices made once at build."""

from dataclasses import dataclass

import numpy as np

from anysim.conventions import Array
from anysim.model.world import BodyKind, World
from anysim_mechanics.trees import members


@dataclass(frozen=True)
class Layout:
    """Indices into the World's lists, of what is there.

    A body with links below it is the root of an articulation; other free and static bodies are actors of their own.
    """

    trees: tuple[tuple[int, ...], ...]
    """Per articulation its bodies, the root first, parents before children."""
    actors: tuple[int, ...]
    """Bodies that are no part of an articulation."""
    tree_of: Array
    """(B,) articulation of each body, -1 for actors."""
    there: Array
    """(B,) bool: bodies that are there."""
    joint_there: Array
    """(J,) bool: joints that are there."""
    fixed: Array
    """(B,) bool: bodies that are there and that nothing moves."""
    free: Array
    """(B,) bool: free bodies that are there."""
    links: Array
    """(L,) links, without roots, that are there."""

    @classmethod
    def of(cls, world: World, there: Array | None = None) -> "Layout":
        """Sort the World's bodies, or those of them (B,) that are there."""
        if there is None:
            there = np.ones(len(world.bodies), dtype=bool)
        trees = {root: tuple(bodies) for root, bodies in members(world).items() if there[root]}
        articulated = [bodies for bodies in trees.values() if len(bodies) > 1]
        tree_of = np.full(len(world.bodies), -1)
        for number, bodies in enumerate(articulated):
            tree_of[list(bodies)] = number
        return cls(
            trees=tuple(articulated),
            actors=tuple(root for root, bodies in trees.items() if len(bodies) == 1),
            tree_of=tree_of,
            there=there,
            joint_there=there[np.array([joint.body for joint in world.joints], dtype=int)],
            fixed=np.array([b.kind is BodyKind.STATIC for b in world.bodies], dtype=bool) & there,
            free=np.array([b.kind is BodyKind.FREE for b in world.bodies], dtype=bool) & there,
            links=np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.LINK and there[i]], dtype=int),
        )
