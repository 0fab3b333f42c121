"""Contents of an engine that a rebuild carries over by name: parameters, poses and velocities."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Self

import numpy as np

from anysim.conventions import Array
from anysim.engine.parameters import PARAMETERS, count
from anysim.engine.records import EnvRecords
from anysim.engine.state import State
from anysim.model.index import paired
from anysim.model.world import BodyKind, World


class Kept(NamedTuple):
    """Copies of what an engine had before a rebuild, in the order of its old World.

    Attributes:
        world: the old World.
        records: what the contract keeps of all envs.
        body_pose: (N, B, 7), and `body_twist` (N, B, 6).
        joint_pos: (N, J), and `joint_vel` (N, J).
        changed: values (N, K, ...) of the parameters that were changed, by name.
        solver: what `Primitives._carry_rows` returned.
    """

    world: World
    records: EnvRecords
    body_pose: Array
    body_twist: Array
    joint_pos: Array
    joint_vel: Array
    changed: Mapping[str, Array]
    solver: Any

    @classmethod
    def of(cls, world: World, state: State, records: EnvRecords, changed: Mapping[str, Array], solver: Any) -> Self:
        """From the present state, of which everything is read here."""
        poses, twists = state.body_pose, state.body_twist
        return cls(world, records, poses, twists, state.joint_pos, state.joint_vel, changed, solver)

    def parameters(self, world: World) -> Iterator[tuple[str, Array, Array]]:
        """Name, indices (K,) in another World and values (N, K, ...) of the parameters that it has too."""
        for name, values in self.changed.items():
            before, after = paired(self.world, world, PARAMETERS[name].target)
            if count(PARAMETERS[name], world) and len(after):
                yield name, after, values[:, before]

    def bodies(self, world: World) -> Iterator[tuple[Array, Array, Array | None]]:
        """Indices (K,) in another World, poses (N, K, 7) and, of free ones, twists (N, K, 6) of its root bodies."""
        before, after = paired(self.world, world, "bodies")
        for kind in (BodyKind.STATIC, BodyKind.FREE):
            chosen = np.array([world.bodies[i].kind is kind for i in after], dtype=bool)
            if chosen.any():
                twists = self.body_twist[:, before[chosen]] if kind is BodyKind.FREE else None
                yield after[chosen], self.body_pose[:, before[chosen]], twists

    def joints(self, world: World) -> tuple[Array, Array, Array]:
        """Indices (K,) in another World, and positions and velocities (N, K)."""
        before, after = paired(self.world, world, "joints")
        return after, self.joint_pos[:, before], self.joint_vel[:, before]
