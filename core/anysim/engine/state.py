"""State, snapshots and measurements that an engine gives out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots import file as snapshot_file
from anysim.engine.snapshots.row_checks import mapping_of_arrays
from anysim.errors import SnapshotError, StaleStateError
from anysim.math.arrays import array


class SnapshotLevel(StrEnum):
    """How much of the engine a snapshot holds.

    STATE: poses, velocities, controls; continuing is close. TRAJECTORY: continuing equals the uninterrupted run, bit
    for bit.
    """

    STATE = "state"
    TRAJECTORY = "trajectory"


@dataclass(frozen=True)
class Snapshot:
    """Rows of an engine's state, opaque but for its stamp. `data` maps names to arrays with a leading env axis."""

    engine: str
    engine_version: str
    world_hash: str
    level: SnapshotLevel
    data: Mapping[str, Array] = field(repr=False)

    @property
    def num_envs(self) -> int:
        """How many envs the snapshot holds."""
        return next((len(rows) for rows in self.data.values() if rows.ndim), 0)

    def rows(self, rows: Sequence[int] | Array) -> "Snapshot":
        """Some of its envs, in this order; one may come several times."""
        which = row_numbers(rows, self.num_envs)
        return replace(self, data={name: array[which] for name, array in self.data.items()})

    def save(self, path: str | Path) -> Path:
        """Write a file that `load` reads in any process; an existing one is replaced."""
        return snapshot_file.write(path, snapshot_file.ENGINE, stamp_of(self), self.data)

    @classmethod
    def load(cls, path: str | Path) -> "Snapshot":
        """Read what `save` wrote.

        Raises:
            SnapshotError: the file is damaged, of a newer format, or was made with other versions.
        """
        content = snapshot_file.read(path)
        return stamped(content.stamp, snapshot_file.expect(content, snapshot_file.ENGINE, path))


def stamp_of(snapshot: Snapshot) -> dict[str, object]:
    """What a snapshot belongs to, as plain data."""
    return {
        "engine": snapshot.engine,
        "engine_version": snapshot.engine_version,
        "world_hash": snapshot.world_hash,
        "level": str(snapshot.level),
        "envs": snapshot.num_envs,
    }


def stamp_words(stamp: Mapping[str, Any], *names: str) -> list[str]:
    """Words of a stamp.

    Raises:
        SnapshotError: one is missing, or something else.
    """
    missing = [name for name in names if not isinstance(stamp.get(name), str)]
    if missing:
        raise SnapshotError(f"the snapshot is damaged: its stamp says no '{missing[0]}'; take a new one")
    return [stamp[name] for name in names]


def stamped(stamp: Mapping[str, Any], data: object) -> Snapshot:
    """The snapshot of a stamp and its data, which may come from anywhere.

    Raises:
        SnapshotError: the stamp is not one, or the data are no arrays by name.
    """
    engine, version, world, level = stamp_words(stamp, "engine", "engine_version", "world_hash", "level")
    if level not in list(SnapshotLevel):
        raise SnapshotError(f"the snapshot is damaged: there is no level {level!r}; take a new one")
    return Snapshot(engine, version, world, SnapshotLevel(level), mapping_of_arrays("the engine's state", data))


def row_numbers(rows: Sequence[int] | Array, count: int) -> Array:
    """Row numbers of a snapshot as an index array.

    Raises:
        SnapshotError: one is not in it.
    """
    which = array("rows", rows, SnapshotError)
    if which.ndim != 1 or (which.size and not np.issubdtype(which.dtype, np.integer)):
        raise SnapshotError(f"rows of a snapshot are chosen by their numbers, got {which.dtype} {which.shape}")
    if which.size and not 0 <= which.min() <= which.max() < count:
        raise SnapshotError(f"the snapshot has rows 0 to {count - 1}, not {which.tolist()}")
    return which.astype(int)


def joined(snapshots: Sequence[Snapshot]) -> Snapshot:
    """One snapshot of the envs of several, in order, such as those of engines that share the envs of a world.

    Raises:
        SnapshotError: there is none, they have different stamps, or a parameter was changed in one engine only.
    """
    if not snapshots:
        raise SnapshotError("there is no snapshot to join; pass one or more")
    first, waiting = snapshots[0], "commands.wrench"
    for other in snapshots[1:]:
        for name in ("engine", "engine_version", "world_hash", "level"):
            ours, theirs = getattr(first, name), getattr(other, name)
            if ours != theirs:
                raise SnapshotError(f"snapshots of {name.replace('_', ' ')} {ours} and {theirs} cannot be joined")
    parts = [dict(snapshot.data) for snapshot in snapshots]
    wrench = next((part[waiting] for part in parts if waiting in part), None)
    if wrench is not None:
        # where none waits, none is kept: it is a wrench of zero
        for part, snapshot in zip(parts, snapshots, strict=True):
            part.setdefault(waiting, np.zeros((snapshot.num_envs, *wrench.shape[1:])))
    return Snapshot(first.engine, first.engine_version, first.world_hash, first.level, joined_rows(parts))


def joined_rows(parts: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Rows of several mappings, one after the other, by name.

    Rows of an engine may have different lengths, such as saved files: the shorter ones get zeros at their end, which
    the engine passes over.

    Raises:
        SnapshotError: a name is not in all of them, or rows differ in more than their length.
    """
    names = dict.fromkeys(name for part in parts for name in part)
    for name in names:
        if not all(name in part for part in parts):
            raise SnapshotError(
                f"'{name}' is in some of the snapshots and not in all, so they cannot be joined; change a parameter in "
                f"all engines, or in none"
            )
    return {name: _stacked(name, [part[name] for part in parts]) for name in names}


def _stacked(name: str, rows: Sequence[Array]) -> Array:
    shapes = sorted({r.shape[1:] for r in rows})
    if len(shapes) == 1:
        return np.concatenate(rows)
    if any(len(shape) != 1 for shape in shapes):
        raise SnapshotError(f"rows of '{name}' have shapes {shapes[0]} and {shapes[-1]}; they cannot be joined")
    width = max(shape[0] for shape in shapes)
    return np.concatenate([np.pad(r, ((0, 0), (0, width - r.shape[1]))) for r in rows])


class Availability(NamedTuple):
    """Whether an engine can run here. `missing` lists what is not, `remedy` says how to get it."""

    available: bool
    version: str = ""
    missing: tuple[str, ...] = ()
    remedy: str = ""


class RayHits(NamedTuple):
    """`distance` (E, R) [m], inf where nothing is hit; `entity` (E, R) segmentation id, 0 for ground, -1 for no hit."""

    distance: Array
    entity: Array


class ContactPoints(NamedTuple):
    """All contacts of the chosen envs, C rows.

    env (C,) int; body_a, body_b (C,) int, -1 for the world; position (C, 3) [m]; normal (C, 3) unit, from a to b;
    force (C, 3) [N] on b, world axes; depth (C,) [m], positive in penetration.
    """

    env: Array
    body_a: Array
    body_b: Array
    position: Array
    normal: Array
    force: Array
    depth: Array

    @classmethod
    def joined(cls, parts: Sequence[Sequence[Array]]) -> "ContactPoints":
        """Those of several envs: all columns of each, one after the other."""
        whole, rows = np.zeros(0, dtype=int), np.zeros((0, 3))
        none = (whole, whole, whole, rows, rows, rows, np.zeros(0))
        return cls(*(np.concatenate(column) for column in zip(none, *parts, strict=True)))


FIELDS = ("body_pose", "body_twist", "joint_pos", "joint_vel", "joint_effort", "contact_force", "fault")


class State:
    """The state of all envs after a step. Fields are read from the engine on first use and are read-only copies.

    A field that was not read before the engine moved on is gone: reading it then raises StaleStateError. Read what you
    want to keep; arrays that were read stay valid and unchanged for ever.
    """

    __slots__ = ("_arrays", "_live", "_read", "time")

    def __init__(self, read: Callable[[str], Array], time: Array) -> None:
        self._read = read
        self._arrays: dict[str, Array] = {}
        self._live = True
        self.time = time
        """Simulated time of each env since its reset (N,) [s]."""

    def retire(self) -> None:
        """Called by the engine when it moves on."""
        self._live = False

    def _get(self, name: str) -> Array:
        array = self._arrays.get(name)
        if array is None:
            if not self._live:
                raise StaleStateError(
                    f"state.{name} was not read before the engine moved on; call get_state() again after the step"
                )
            array = self._read(name)
            array.setflags(write=False)
            self._arrays[name] = array
        return array

    @property
    def body_pose(self) -> Array:
        """(N, B, 7) [m, xyzw]: frames of the bodies in the world."""
        return self._get("body_pose")

    @property
    def body_twist(self) -> Array:
        """(N, B, 6) [m/s, rad/s]: velocity of the frame origin and angular rate, world axes."""
        return self._get("body_twist")

    @property
    def joint_pos(self) -> Array:
        """(N, J) [rad] or [m]."""
        return self._get("joint_pos")

    @property
    def joint_vel(self) -> Array:
        """(N, J) [rad/s] or [m/s]."""
        return self._get("joint_vel")

    @property
    def joint_effort(self) -> Array:
        """(N, J) [N m] or [N]: what the drives exerted in the last substep, after clipping; 0 without a drive."""
        return self._get("joint_effort")

    @property
    def contact_force(self) -> Array:
        """(N, S, 3) [N]: the declared contact sensors, in the order of `World.contact_sensors`."""
        return self._get("contact_force")

    @property
    def fault(self) -> Array:
        """(N,) bool: the env's state is not finite, or its engine gave up on it."""
        return self._get("fault")
