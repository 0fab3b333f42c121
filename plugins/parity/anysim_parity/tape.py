"""A reproducible tape of joint targets: smooth moves between random waypoints, then a rest."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.world import ControlMode, World

MOVES, MOVE, REST = 4, 0.5, 1.0
"""How many moves, the duration of each, and the rest at the end [s]."""

REACH, SHARE, MARGIN = 0.4, 0.4, 0.1
"""Waypoints are up to this far [rad or m] from the initial position, at most this share of the range, and keep this
share of the range away from the limits."""


class Tape(NamedTuple):
    """Targets (T, A) of the actuators, one row for each control step; the last `rest` rows are equal."""

    targets: Array
    rest: int


def make_tape(world: World, rng: np.random.Generator) -> Tape:
    """The tape of a world's position drives; the others stay at their joints' initial positions."""
    joints = [world.joints[a.joint] for a in world.actuators]
    start = np.array([j.initial for j in joints])
    lower, upper = np.array([j.lower for j in joints]), np.array([j.upper for j in joints])
    width = upper - lower
    reach = np.minimum(REACH, SHARE * width) * [a.mode is ControlMode.POSITION for a in world.actuators]
    inner = np.where(np.isfinite(width), MARGIN * np.where(np.isfinite(width), width, 0.0), 0.0)
    way = start + reach * rng.uniform(-1.0, 1.0, (MOVES, len(start)))
    way = np.clip(way, np.minimum(lower + inner, start), np.maximum(upper - inner, start))
    control_dt = world.physics.control_dt
    count, rest = max(2, round(MOVE / control_dt)), max(2, round(REST / control_dt))
    phase = np.arange(1, count + 1)[:, None] / count
    blend = phase**3 * (10 - 15 * phase + 6 * phase**2)  # minimum jerk
    rows = [a + (b - a) * blend for a, b in zip([start, *way], way, strict=False)]
    return Tape(np.concatenate([*rows, np.repeat(way[-1:], rest, axis=0)]), rest)
