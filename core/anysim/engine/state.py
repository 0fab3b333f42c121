"""State, snapshots and measurements that an engine gives out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from anysim.conventions import Array
from anysim.errors import StaleStateError


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
        return next((len(rows) for rows in self.data.values()), 0)

    def rows(self, rows: Sequence[int] | Array) -> "Snapshot":
        """Some of its envs, in this order; one may come several times."""
        from anysim.engine.snapshot import chosen_rows

        return chosen_rows(self, rows)

    def save(self, path: str | Path) -> Path:
        """Write a file that `load` reads in any process; an existing one is replaced."""
        from anysim.engine.snapshot import save

        return save(self, path)

    @classmethod
    def load(cls, path: str | Path) -> "Snapshot":
        """Read what `save` wrote.

        Raises:
            SnapshotError: the file is damaged, of a newer format, or was made with other versions.
        """
        from anysim.engine.snapshot import load

        return load(path)


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
