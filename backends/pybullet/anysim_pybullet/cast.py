"""Entities present in an env, as index arrays that are made once for each set of them."""

from dataclasses import dataclass

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.engine.presence import bodies_there
from anysim.model.world import World
from anysim_mechanics.trees import Tree


@dataclass(frozen=True)
class Cast:
    """Indices are the World's, and `PairRules`' for shapes. What moves is listed free roots first, then links."""

    present: Array  # (E,) bool, the entities
    trees: list[Tree]
    bodies: Array  # (B,) bool
    joints: Array  # (J,) those that are there
    shapes: Array  # (K,) those that are there
    free: list[tuple[int, int]]  # number and root of each tree with a free root
    linked: list[tuple[int, Array]]  # number and joints of each tree that has some
    links: Array
    moving: Array
    jointed: Array  # the joints of `linked`, one after the other

    @classmethod
    def of(cls, world: World, trees: list[Tree], shape_geoms: Array, present: Array) -> "Cast":
        """Those of the entities (E,) that are present, of shapes that belong to these geoms (K,)."""
        bodies = bodies_there(world, present)
        there = [tree for tree in trees if bodies[tree.bodies[0]]]
        of_body = np.array([world.geoms[i].body for i in shape_geoms.tolist()], dtype=int)
        free = [(t.number, int(t.bodies[0])) for t in there if t.free]
        links = np.concatenate([np.zeros(0, dtype=int), *(t.bodies[1:] for t in there if len(t.joints))])
        moving = np.concatenate([np.array([body for _, body in free], dtype=int), links])
        return cls(
            present=present,
            trees=there,
            bodies=bodies,
            joints=np.array([i for i, joint in enumerate(world.joints) if bodies[joint.body]], dtype=int),
            shapes=np.flatnonzero((of_body == WORLD) | np.append(bodies, True)[of_body]),
            free=free,
            linked=[(t.number, t.joints) for t in there if len(t.joints)],
            links=links,
            moving=moving,
            jointed=np.concatenate([np.zeros(0, dtype=int), *(t.joints for t in there)]),
        )
