"""Clips: how trunk, arms and head are held over time, by name; more can be added with `clip`.

A posture is a row of numbers in the avatar's own frames, so that one clip fits all sizes.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array

POSTURE = 13
DROP, BACK, LEAN, ROLL, TWIST = range(5)
LEFT, RIGHT = slice(5, 8), slice(8, 11)
"""Where the palms are from the shoulders, in the trunk's axes (forward, left, up), in lengths of an arm."""
LOOK_YAW, LOOK_PITCH = 11, 12


class Moment(NamedTuple):
    """What a clip may depend on, (m,) each: time since it began [s], phase of the gait [rad], speed [m/s].

    `drop` [m] is how far a seat lowers the hips.
    """

    time: Array
    gait: Array
    speed: Array
    drop: Array


Clip = Callable[[Moment], Array]
"""Postures (m, 13): how far the hips are below standing [m] and behind [m], lean, roll and twist of the trunk [rad],
the palms, and where the head looks [rad]."""
CLIPS: dict[str, Clip] = {}


def clip(function: Clip) -> Clip:
    """Add a clip under its function's name."""
    CLIPS[function.__name__] = function
    return function


def standing(rows: int) -> Array:
    """(m, 13) arms that hang, nothing else."""
    posture = np.zeros((rows, POSTURE))
    posture[:, LEFT], posture[:, RIGHT] = (0.08, 0.10, -0.965), (0.08, -0.10, -0.965)
    return posture


@clip
def idle(now: Moment) -> Array:
    """Standing, breathing, the weight going from foot to foot."""
    posture = standing(len(now.time))
    slow = np.sin(0.7 * now.time)
    posture[:, ROLL], posture[:, LEAN] = 0.012 * slow, 0.01 + 0.006 * np.sin(1.6 * now.time)
    posture[:, LOOK_YAW] = 0.15 * np.sin(0.31 * now.time) * np.sin(0.17 * now.time)
    return posture


@clip
def walk(now: Moment) -> Array:
    """Arms that swing against the legs, the wider the faster."""
    posture = standing(len(now.time))
    swing = 0.32 * np.minimum(now.speed / 1.2, 1.3) * np.cos(now.gait)
    for arm, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        forward = sign * swing
        posture[:, arm] = np.stack(
            [0.06 + forward, np.full_like(swing, 0.12 * sign), -0.93 + 0.35 * forward**2], axis=-1
        )
    posture[:, TWIST] = -0.06 * np.minimum(now.speed, 1.5) * np.cos(now.gait)
    posture[:, LEAN] = 0.03 + 0.03 * now.speed
    return posture


@clip
def talk(now: Moment) -> Array:
    """Standing, with hands that speak."""
    posture, t = idle(now), now.time
    beat = np.sin(2.9 * t) * np.sin(0.9 * t + 0.6)
    other = np.sin(2.3 * t + 1.1) * np.sin(0.7 * t)
    posture[:, RIGHT] = np.stack([0.50 + 0.10 * beat, -0.08 + 0.14 * other, -0.38 + 0.16 * beat], axis=-1)
    posture[:, LEFT] = np.stack([0.44 + 0.06 * other, 0.08 - 0.10 * beat, -0.48 + 0.10 * other], axis=-1)
    posture[:, LOOK_PITCH] = 0.06 * np.sin(1.9 * t)
    return posture


@clip
def sit(now: Moment) -> Array:
    """On a seat behind it, the hands on the thighs."""
    posture = standing(len(now.time))
    posture[:, DROP], posture[:, BACK], posture[:, LEAN] = now.drop, 0.34, 0.03 + 0.006 * np.sin(1.5 * now.time)
    posture[:, LEFT], posture[:, RIGHT] = (0.52, -0.02, -0.70), (0.52, 0.02, -0.70)
    return posture


@clip
def wave(now: Moment) -> Array:
    """The right hand greets."""
    posture = idle(now)
    side = 0.16 * np.sin(7.0 * now.time)
    posture[:, RIGHT] = np.stack([0.28 + 0 * side, -0.30 + side, 0.62 - 0.2 * np.abs(side)], axis=-1)
    return posture


@clip
def carry(now: Moment) -> Array:
    """Both forearms held out in front, level, as below a tray."""
    posture = standing(len(now.time))
    posture[:, LEFT], posture[:, RIGHT] = (0.62, -0.08, -0.42), (0.62, 0.08, -0.42)
    return posture
