"""Actions as rows of numbers, which the memory of an env can hold: what avatars do, and are after meanwhile."""

from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum

import numpy as np

from anysim.conventions import Array
from anysim.randomization.distributions import nominal
from anysim_avatars.spec import ActionSpec

LENGTH = 32
"""Rows of a queue; a path takes one for each of its points."""


class Column(IntEnum):
    """The columns of a row; points are in three of them."""

    KIND = 0
    CLIP = 1
    SECONDS = 2
    X = 3
    Y = 4
    BODY = 5
    NEAR = 6
    SPEED = 7
    ENDS = 8
    YAW = 9
    SEAT = 10
    GAZING = 11
    GAZE_BODY = 12
    GAZE = 13
    REACHING = 16
    HAND = 17
    REACH_BODY = 18
    REACH = 19
    BEND = 22
    EASE = 23


WIDTH = 24
DRAWN = {"seconds": slice(Column.SECONDS, Column.SECONDS + 1), "reach": slice(Column.REACH, Column.REACH + 3)}
"""Where the values of an action are that may be drawn anew in each episode."""


class Kind(IntEnum):
    """Ways of spending time."""

    NOTHING = 0
    CLIP = 1
    GO = 2
    TURN = 3


FindBody = Callable[[str], int]
FindClip = Callable[[str], int]


def rows_of(action: ActionSpec, body: FindBody, clip: FindClip) -> list[Array]:
    """The rows of one action."""
    row = np.zeros(WIDTH)
    row[[Column.BODY, Column.GAZE_BODY, Column.REACH_BODY]] = -1
    row[Column.SPEED], row[Column.SEAT], row[Column.BEND] = action.speed, action.seat, action.bend
    row[Column.NEAR], row[Column.ENDS] = action.near, 1
    row[Column.SECONDS] = np.inf if action.seconds is None else nominal(action.seconds)
    row[Column.EASE] = action.ease
    for target, flag, where, at in (
        (action.gaze, Column.GAZING, Column.GAZE_BODY, Column.GAZE),
        (action.reach, Column.REACHING, Column.REACH_BODY, Column.REACH),
    ):
        if target is not None:
            row[flag] = 1
            if isinstance(target, str):
                row[where] = body(target)
            else:
                row[at : at + 3] = nominal(target)
    row[Column.HAND] = action.hand == "right"
    points: Sequence[tuple[float, float]] = action.path or ()
    if action.path is not None or action.go_to is not None:
        row[Column.KIND], row[Column.CLIP] = Kind.GO, clip(action.clip or "walk")
        if isinstance(action.go_to, str):
            row[Column.BODY] = body(action.go_to)
            return [_finite(row)]
        points = points or (action.go_to,) if action.go_to is not None else points
    elif action.turn_to is not None:
        row[Column.KIND], row[Column.CLIP], row[Column.YAW] = Kind.TURN, clip(action.clip or "idle"), action.turn_to
    else:
        row[Column.KIND], row[Column.CLIP] = Kind.CLIP, clip(action.clip or "idle")
    found = [row.copy() for _ in range(max(len(points), 1))]
    for one, point in zip(found, points, strict=False):
        one[[Column.X, Column.Y]] = point
    for one in found[:-1]:
        one[Column.ENDS] = 0
    return [_finite(one) for one in found]


def _finite(row: Array) -> Array:
    """Snapshots hold finite numbers: what lasts for ever lasts 1e9 s."""
    row[Column.SECONDS] = min(row[Column.SECONDS], 1e9)
    return row


def queue(actions: Iterable[ActionSpec], body: FindBody, clip: FindClip) -> Array:
    """(LENGTH, WIDTH) the rows of actions, and rows of nothing.

    Raises:
        ValueError: they are too many, or what `body` and `clip` raise.
    """
    rows = [row for action in actions for row in rows_of(action, body, clip)]
    if len(rows) > LENGTH:
        raise ValueError(f"an avatar's queue holds {LENGTH} actions and points of paths, here are {len(rows)}")
    table = np.zeros((LENGTH, WIDTH))
    table[: len(rows)] = np.array(rows).reshape(-1, WIDTH)
    return table
