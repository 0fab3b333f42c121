"""Twists of all bodies from what SAPIEN packs: those of links are sums over the joints between a link and its root.

PhysX' own velocities of links belong to the poses before the step.
"""

import numpy as np

from anysim.conventions import Array
from anysim.model.world import BodyKind, JointType, World
from anysim_sapien.packing import Batch


class Twists:
    """The constants of a World, made once."""

    def __init__(self, world: World) -> None:
        from anysim_sapien import kernels  # numba, where a world is built

        self._kernel = kernels.twists
        self._bodies = len(world.bodies)
        self._free = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.FREE], dtype=int)
        self._links = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.LINK], dtype=int)
        self._body = np.array([j.body for j in world.joints], dtype=int)
        self._axis = np.array([j.axis for j in world.joints], dtype=float).reshape(-1, 3)
        self._anchor = np.array([j.anchor for j in world.joints], dtype=float).reshape(-1, 3)
        self._turns = np.array([j.type is JointType.REVOLUTE for j in world.joints], dtype=float)
        root, chains = list(range(len(world.bodies))), [list[int]() for _ in world.bodies]
        for i in self._links.tolist():
            parent = world.bodies[i].parent
            root[i], chains[i] = root[parent], [*chains[parent], world.body_joint[i]]
        self._root = np.array(root, dtype=int)[self._links]
        # sums run up the joints' numbers
        ordered = [sorted(chains[i]) for i in self._links.tolist()]
        self._first = np.cumsum([0, *(len(chain) for chain in ordered)])
        self._chain = np.array([joint for chain in ordered for joint in chain], dtype=int)

    def of(self, packed: Array, batch: Batch, com: Array) -> Array:
        """(N, B, 6) from packed states (L,), with centres of mass (N, B, 3) in the bodies' frames."""
        twists = np.zeros((len(com), self._bodies, 6))
        self._kernel(
            packed,
            batch.pose,
            batch.velocity,
            batch.joint_vel,
            com,
            self._free,
            self._body,
            self._axis,
            self._anchor,
            self._turns,
            self._links,
            self._root,
            self._first,
            self._chain,
            twists,
        )
        return twists
