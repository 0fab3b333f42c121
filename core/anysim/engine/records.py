"""Records of all envs that the contract keeps itself, whatever the engine, and what a rebuild carries over."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Self

import numpy as np

from anysim.conventions import Array
from anysim.engine.cameras import CameraRig
from anysim.engine.control import MODES, CommandBuffer
from anysim.engine.parameters import PARAMETERS, count
from anysim.engine.presence import Presence
from anysim.engine.snapshots.row_checks import refuse_other_forms, refuse_range, refuse_rotations, told
from anysim.engine.state import State
from anysim.model.index import paired
from anysim.model.world import BodyKind, World

_LAST_TICK = 1 << 53
"""Physics steps after a reset: beyond it a time is no exact number any more."""


class EnvRecords:
    """Clocks, commands, camera poses, presence and changed parameters of all envs of one World.

    An engine owns one for its world. Its own rows, such as poses and warm starts, are not in it.

    Attributes:
        ticks: (N,) int64, physics steps since each env's reset.
        commands: drive targets and waiting wrenches.
        rig: camera poses and fields of view.
        presence: which entities are there.
        changed: the names of parameters that were written since the build, in order.
        appearance: (N,) int64, how often what is seen in an env was changed, other than by the motion of its bodies.
    """

    def __init__(self, world: World, num_envs: int) -> None:
        self.world = world
        self.ticks = np.zeros(num_envs, dtype=np.int64)
        self.commands = CommandBuffer(world, num_envs)
        self.rig = CameraRig(world, num_envs)
        self.presence = Presence(world, num_envs)
        self.changed: dict[str, None] = {}
        self.appearance = np.zeros(num_envs, dtype=np.int64)

    def reset(self, ids: Array) -> None:
        """Start the clocks of envs anew, and have their drives hold the initial joint positions."""
        self.commands.reset(ids)
        self.ticks[ids] = 0

    def snapshot(self, ids: Array) -> dict[str, Array]:
        """Rows of envs by name, for a snapshot; changed parameters are the engine's to add."""
        data: dict[str, Array] = {"ticks": self.ticks[ids], "cameras": self.rig.poses[ids], "fov": self.rig.fov[ids]}
        if self.presence.varies:
            data["present"] = self.presence.entities[ids]
        return data | {f"commands.{name}": rows for name, rows in self.commands.rows(ids).items()}

    def refuse_foreign(self, data: Mapping[str, Array], ids: Array) -> None:
        """Refuse rows of envs that `snapshot` could not have made in this world.

        Raises:
            SnapshotError: what differs first.
        """
        waiting = {"commands.wrench": np.zeros((1, len(self.world.bodies), 6))}
        like = waiting | self.snapshot(np.array([0]))
        refuse_other_forms("the engine's state", data, like, len(ids), optional=waiting)
        refuse_range("ticks", data["ticks"], 0, _LAST_TICK)
        refuse_range("commands.mode", data["commands.mode"], 0, len(MODES) - 1)
        refuse_range("fov", data["fov"], 1e-6, 180.0)
        refuse_rotations("cameras", data["cameras"][..., 3:])
        if "present" in data:
            with told():
                self.presence.checked(data["present"], ids)

    def restore(self, ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned, but for presence, which needs the engine."""
        self.commands.restore(ids, below("commands.", data))
        self.rig.poses[ids], self.rig.fov[ids] = data["cameras"], data["fov"]
        self.ticks[ids] = data["ticks"]
        self.appearance[ids] += 1

    def carry(self, old: "EnvRecords") -> None:
        """Take over from the records of another World what both have by name: commands, cameras, and the clocks.

        Presence goes before, with `Presence.carry`: an engine builds by it.
        """
        before, after = paired(old.world, self.world, "actuators")
        for theirs, ours in zip(old.commands.control, self.commands.control, strict=True):
            ours[:, after] = theirs[:, before]
        self.rig.carry(old.rig)
        self.ticks[:] = old.ticks
        self.appearance[:] = old.appearance + 1

    def add_cameras(self, world: World) -> None:
        """Go on with the same World with more cameras."""
        rig = CameraRig(world, len(self.ticks))
        rig.carry(self.rig)
        self.world, self.rig = world, rig


class RebuildState(NamedTuple):
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


def below(prefix: str, data: Mapping[str, Array]) -> dict[str, Array]:
    """The entries of a snapshot whose names begin with `prefix`, without it."""
    return {name[len(prefix) :]: rows for name, rows in data.items() if name.startswith(prefix)}
