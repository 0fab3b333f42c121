"""Straight tool lines at limited speed: one target pose a control tick, for `InverseKinematics.step` to follow.

Elementwise arithmetic only: a row's poses do not depend on the rows beside it.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.math import pose as P


class Line(NamedTuple):
    """Target poses along n straight lines.

    Attributes:
        poses: (n, T, 7) the target of tick t, for t = 0 … T-1. The start is not among them; a row that arrives before
            the longest one holds its goal.
        ticks: (n,) int64, how many ticks a row takes; `poses[i, ticks[i] - 1]` is its goal, at least 1.
    """

    poses: Array
    ticks: Array


def interpolate(start: Array, goal: Array, fraction: Array) -> Array:
    """Poses (..., 7) at `fraction` (...) in [0, 1] of the way from `start` to `goal` (..., 7).

    The position moves on the straight line, the orientation on the shorter arc, both at constant rate. 0 gives `start`
    and 1 gives `goal`, bit for bit.
    """
    part = np.clip(fraction, 0.0, 1.0)[..., None]
    position = start[..., :3] + part * (goal[..., :3] - start[..., :3])
    turn = P.rotation_vector(P.multiply(P.conjugate(start[..., 3:]), goal[..., 3:]))
    angle = P.norm(turn)
    axis = turn / np.where(angle > 0.0, angle, 1.0)[..., None]
    quaternion = P.multiply(start[..., 3:], P.from_axis_angle(axis, part[..., 0] * angle))
    between = np.concatenate([position, P.normalize(quaternion)], axis=-1)
    return np.where(part <= 0.0, start, np.where(part >= 1.0, goal, between))


def straight_line(start: Array, goal: Array, *, speed: float, turn_rate: float, dt: float) -> Line:
    """Follow straight lines no faster than `speed` and `turn_rate`, whichever takes longer, and at constant pace.

    Args:
        start: (n, 7) poses of the tool now.
        goal: (n, 7) poses to arrive at.
        speed: [m/s] the most the position may move.
        turn_rate: [rad/s] the most the orientation may turn.
        dt: [s] the time of a tick.

    Raises:
        AnysimError: shapes that differ or are not (n, 7), or a limit that is not positive.
    """
    start, goal = np.asarray(start, dtype=float), np.asarray(goal, dtype=float)
    if start.shape != goal.shape or start.ndim != 2 or start.shape[1] != 7:
        raise AnysimError(
            f"straight_line: expected start and goal of one shape (n, 7), got {start.shape} and {goal.shape}"
        )
    for name, value in (("speed", speed), ("turn_rate", turn_rate), ("dt", dt)):
        if not value > 0:
            raise AnysimError(f"straight_line: {name} must be positive, got {value}")
    distance = P.norm(goal[:, :3] - start[:, :3])
    seconds = np.maximum(distance / speed, P.angle_between(start[:, 3:], goal[:, 3:]) / turn_rate)
    if not np.isfinite(seconds).all():
        raise AnysimError(
            f"straight_line: poses are not finite in rows {np.flatnonzero(~np.isfinite(seconds))[:8].tolist()}"
        )
    # The margin keeps a whole number of ticks from becoming one more by rounding.
    ticks = np.maximum(np.ceil(seconds / dt - 1e-9), 1.0)
    longest = int(ticks.max(initial=0.0))
    fraction = (np.arange(longest) + 1.0) / ticks[:, None]
    shape = (len(start), longest, 7)
    poses = interpolate(np.broadcast_to(start[:, None], shape), np.broadcast_to(goal[:, None], shape), fraction)
    return Line(poses, ticks.astype(np.int64))
