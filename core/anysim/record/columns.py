"""Columns of episodes: an array for each field, filled row by row while an episode runs, handed on whole at its end.

What the numbers of an episode must be is looked at then, once for each column.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.header import Header, StateLayout

MAX_CAPACITY = 1024
"""No more rows for each episode are kept ready than this; longer ones make the columns grow."""

Field = tuple[str, str]
"""(`state`, `joint_pos`), (`obs`, `policy`); `time`, `reward` and `action` have no second name."""
TIME, REWARD, ACTION = ("time", ""), ("reward", ""), ("action", "")


class Change(NamedTuple):
    """A value that holds from a row on, until the next change of it."""

    row: int
    value: Any


@dataclass(frozen=True)
class EpisodeColumns:
    """A whole episode of F frames, as a writer gets it. Row r is the frame of control step `first_step` + r.

    Nothing else holds the arrays, and everything in them has been checked: shapes and types are those of the header,
    and times, rewards, states and actions are finite.

    Attributes:
        header: what was known before the first frame.
        first_step: 0 where the initial frame was recorded, else 1.
        time: (F,) simulated time since the reset [s], never decreasing.
        action: (F, A) float64; the row of step 0 is zero and means nothing.
        state: (F, …) by the names of the layout, in its types.
        reward: (F,) float64.
        obs: (F, …) by the names of the layout, in its types.
        status: what the task said, at the rows where it changed; the first is at row 0.
        annotations: plain mappings, at the rows where they changed; empty before the first.
        language: the instruction, at the rows where it changed; that of the header before the first.
        first_image: the control step of the first image of each camera that took one.
    """

    header: Header
    first_step: int
    time: Array
    action: Array
    state: Mapping[str, Array]
    reward: Array
    obs: Mapping[str, Array]
    status: tuple[Change, ...]
    annotations: tuple[Change, ...]
    language: tuple[Change, ...]
    first_image: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.time)

    @property
    def steps(self) -> int:
        """The last control step."""
        return self.first_step + len(self) - 1

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = (self.time, self.action, self.reward, *self.state.values(), *self.obs.values())
        return sum(array.nbytes for array in arrays)

    def state_at(self, row: int) -> dict[str, Array]:
        """The state arrays (…) of one row."""
        return {name: rows[row] for name, rows in self.state.items()}


def fields_of(layout: StateLayout) -> dict[Field, tuple[tuple[int, ...], np.dtype[Any]]]:
    """Shape and type of one row of every field, in the order of sorted names."""
    double = np.dtype(np.float64)
    fields: dict[Field, tuple[tuple[int, ...], np.dtype[Any]]] = {
        TIME: ((), double),
        REWARD: ((), double),
        ACTION: ((len(layout.action),), double),
    }
    fields |= {("state", name): (layout.state[name], np.dtype(layout.dtype(name))) for name in sorted(layout.state)}
    fields |= {("obs", name): (layout.obs[name].shape, np.dtype(layout.obs[name].dtype)) for name in sorted(layout.obs)}
    return fields


class ColumnStore:
    """The columns of all open episodes of a run: for each type one array (slots, capacity, width), fields side by side.

    So a control step of all envs is one assignment. A slot belongs to one open episode.
    """

    def __init__(self, layout: StateLayout, capacity: int) -> None:
        """`capacity`: rows that an episode will hardly exceed."""
        self._fields: dict[np.dtype[Any], dict[Field, tuple[int, ...]]] = {}
        for field, (shape, dtype) in fields_of(layout).items():
            self._fields.setdefault(dtype, {})[field] = shape
        self._capacity = max(2, min(capacity, MAX_CAPACITY))
        self._free: list[int] = []
        self._slots = 0
        self._arrays: dict[np.dtype[Any], Array] = {}
        self._resize(0, self._capacity)

    def open(self) -> int:
        """A free slot."""
        if not self._free:
            self._free = list(range(max(2 * self._slots, 1) - 1, self._slots - 1, -1))
            self._resize(max(2 * self._slots, 1), self._capacity)
        return self._free.pop()

    def release(self, slot: int) -> None:
        """Give a slot back; what it held is lost."""
        self._free.append(slot)

    def write(self, slots: Array, rows: Array, values: Mapping[Field, Array]) -> None:
        """Write one row for each of n episodes: values (n, …) of every field, of the right shapes."""
        last = int(rows.max(initial=0))
        if last >= self._capacity:
            self._resize(self._slots, max(2 * self._capacity, last + 1))
        for dtype, array in self._arrays.items():
            parts = [values[field].reshape(len(rows), -1) for field in self._fields[dtype]]
            array[slots, rows] = np.concatenate(parts, axis=1, dtype=dtype)

    def take(self, slot: int, count: int) -> dict[Field, Array]:
        """Copies (count, …) of the first rows of a slot."""
        taken: dict[Field, Array] = {}
        for dtype, array in self._arrays.items():
            start = 0
            for field, shape in self._fields[dtype].items():
                stop = start + math.prod(shape)
                taken[field] = array[slot, :count, start:stop].copy().reshape(count, *shape)
                start = stop
        return taken

    def _resize(self, slots: int, capacity: int) -> None:
        for dtype, fields in self._fields.items():
            # memory of rows that are never written is never touched, and so is not taken from the system
            fresh = np.empty((slots, capacity, sum(map(math.prod, fields.values()))), dtype)
            if self._slots:
                fresh[: self._slots, : self._capacity] = self._arrays[dtype]
            self._arrays[dtype] = fresh
        self._slots, self._capacity = slots, capacity


MAX_TIME = 2.0**63 / 1e9
"""Log times are 64-bit nanoseconds."""


def where(header: Header) -> str:
    """`env 3, episode 2`, for messages."""
    return f"env {header.episode.env}, episode {header.episode.episode}"


def check_columns(columns: EpisodeColumns) -> None:
    """See that times do not decrease, and that times, rewards, states and actions are finite.

    Raises:
        RecordError: they are not; says at which control step first.
    """
    place = where(columns.header)
    if columns.steps < 1:
        raise RecordError(f"the trajectory of {place} has no steps; append frames before committing it")
    before = np.concatenate([[0.0], columns.time[:-1]])
    wrong = np.flatnonzero(~((before <= columns.time) & (columns.time < MAX_TIME)))
    if len(wrong):
        row = int(wrong[0])
        raise RecordError(
            f"{place}, step {columns.first_step + row}: time {float(columns.time[row])} s; "
            f"{float(before[row])} s or later expected"
        )
    wrong = np.flatnonzero(~np.isfinite(columns.reward))
    if len(wrong):
        row = int(wrong[0])
        raise RecordError(
            f"{place}, step {columns.first_step + row}: the reward is {float(columns.reward[row])}; "
            "a finite number expected"
        )
    for name, rows in {**columns.state, "action": columns.action}.items():
        _check_finite(place, columns.first_step, name, rows)


def _check_finite(place: str, first_step: int, name: str, rows: Array) -> None:
    finite = np.isfinite(rows)
    if finite.all():
        return
    row, *at = (int(i) for i in np.argwhere(~finite)[0])
    raise RecordError(
        f"{place}, step {first_step + row}: {name}{at} is {rows[(row, *at)]}; a trajectory holds finite numbers "
        "only: discard the trajectory of an env whose state is at fault"
    )
