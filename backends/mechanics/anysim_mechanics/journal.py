"""Journal of a scene: everything done to it since it was built, for exact snapshots by playing it again.

A library may keep memory that nothing reads out (PhysX that of contacts). Where the same scene built again and treated
alike comes to the same bits, in any process, its past is its state.

A journal is a sequence of entries of 64-bit floats: what was done, how many numbers follow, and these numbers.
"""

import struct
from collections.abc import Iterator
from enum import IntEnum

import numpy as np

from anysim.conventions import Array
from anysim.errors import SnapshotError

FORMAT = 1
"""Of the entries, in a snapshot: a new number for each change of what an entry means, or of what is done for it."""

_HEAD = struct.Struct("=dd")
_STEPS = struct.Struct("=ddd")


class Op(IntEnum):
    """What can be done to a scene, and the numbers that say how."""

    STEP = 0
    """How many physics steps."""
    CONTROL = 1
    """Targets (position, velocity, effort) and modes of the env's actuators, each (A,)."""
    GAINS = 2
    """kp, kd, effort limits (A,) each, and passive damping (J,)."""
    WRENCH = 3
    """Rows (body, force, torque), for the next entry STEP alone."""
    JOINTS = 4
    """Whether positions and velocities were written, and both (J,)."""
    POSE = 5
    """Body, and the pose (7,) of its frame."""
    VELOCITY = 6
    """Body, and the velocity of its centre of mass and angular rate."""
    INERTIAL = 7
    """Body, mass, centre of mass (3,), inertia (6,)."""
    DRY = 8
    """Joint and dry friction."""
    ARMATURE = 9
    """Joint and armature."""
    BASE = 10
    """Nothing: from here on steps and writes are counted."""
    DAMPING = 11
    """Body and its rates of damping, linear and angular."""


_WRITES = frozenset({Op.JOINTS, Op.POSE, Op.VELOCITY, Op.INERTIAL, Op.DRY, Op.ARMATURE, Op.DAMPING})


class Journal:
    """What was done to one scene."""

    __slots__ = ("_bytes", "_latest", "_waiting", "commanded", "steps", "tuned", "writes")

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all: the scene is as built."""
        self._bytes = bytearray()
        self._waiting = 0
        self.steps, self.writes = 0, 0
        """Physics steps and writes since the last BASE."""
        self._latest: dict[Op, bytes] = {}
        self.commanded, self.tuned = -1, -1
        """Marks of the drives', by which they know that neither changed since."""

    def record(self, op: Op, numbers: bytes) -> None:
        """Add an entry; `numbers` are the bytes of 64-bit floats."""
        if self._waiting:
            self.flush()
        self._bytes += _HEAD.pack(op, len(numbers) // 8) + numbers
        if op in _WRITES:
            self.writes += 1

    def renew(self, op: Op, numbers: bytes) -> None:
        """Add an entry where the latest by this method says something else."""
        if self._latest.get(op, b"") != numbers:
            self._latest[op] = numbers
            self.record(op, numbers)

    def note(self, op: Op, *numbers: Array | float) -> None:
        """Add an entry of numbers and rows of numbers."""
        self.record(op, np.concatenate([np.ravel(n) for n in numbers]).astype(float).tobytes() if numbers else b"")

    def stepped(self, n: int) -> None:
        """Add steps; those that follow each other become one entry."""
        self._waiting += n
        self.steps += n

    def flush(self) -> None:
        """Steps from here on are another entry."""
        if self._waiting:
            self._bytes += _STEPS.pack(Op.STEP, 1, self._waiting)
            self._waiting = 0

    def base(self) -> None:
        """The scene is where its env goes on from: count from here."""
        self.note(Op.BASE)
        self.steps, self.writes = 0, 0

    def rows(self) -> Array:
        """A copy of all entries (L,)."""
        self.flush()
        return np.frombuffer(bytes(self._bytes), dtype=np.float64)

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return len(self._bytes)


def entries(rows: Array) -> Iterator[tuple[Op, Array]]:
    """The entries of a journal's rows.

    Raises:
        SnapshotError: they are not a journal.
    """
    at = 0
    while at < len(rows):
        if at + 2 > len(rows) or not 0 <= rows[at] <= max(Op) or not 0 <= rows[at + 1] <= len(rows) - at - 2:
            raise SnapshotError(
                f"the snapshot is damaged: there is no entry of a journal at number {at} of {len(rows)}"
            )
        stop = at + 2 + int(rows[at + 1])
        yield Op(int(rows[at])), rows[at + 2 : stop]
        at = stop
