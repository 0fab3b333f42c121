"""Checks of whole columns: what an episode's numbers must be, each looked at once when it has ended."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.columns import EpisodeColumns
from anysim.record.header import Header

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
