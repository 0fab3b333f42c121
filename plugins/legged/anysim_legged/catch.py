"""Steps that catch a pushed robot: where the swinging foot may land instead, and how it gets there.

The plan's capture point (divergent component of motion) follows from the pressure ahead alone: a landing that moves by
d, with all that follow, moves it now by g d, where g is about exp(-omega T) for T seconds until the weight is there. A
push that leaves the measured capture point further from the plan than the pressure under the standing feet can hold is
taken by the landing: d = error / g, as in Englsberger, Ott and Albu-Schaeffer 2015 (Three-dimensional bipedal walking
control based on divergent component of motion) and Khadiv, Herzog, Moosavian and Righetti 2016 (Step timing adjustment:
a step toward generating robust gaits), whose steps also end earlier or later.
"""

import numpy as np

from anysim.conventions import Array
from anysim_legged.support import nearest_inside, turned

HELD = 0.8
"""Part of the room for the pressure that an error of the capture point may take before a step is moved."""
SLIGHT = 0.015
"""[m] Errors below it never move a step."""
STANDS = 0.9
"""The same, before a robot that stands begins to step."""
SLOWEST, FASTEST, QUICKENING = 0.8, 1.8, 0.15
"""How fast a step goes on that catches the robot, beside others, and by how much that changes in a tick."""
LEAD = 0.15
"""[s] from the decision to step to the first shift of weight, for a robot that stands."""
SWIFTEST = 15.0
"""[m/s^2] that a foot is accelerated by to land elsewhere."""
UPRIGHT, STRETCH = 0.135, 2.3
"""[m], [1/m] How far aside of its place below the trunk a leg reaches without ado, and how much lower the trunk goes
for more, per square of that: what legs of 0.6 m with knees bent by 35 degrees need, without a jump of speed."""
SETTLED = 0.08
"""[s] before it lands, from which on a foot goes where it was to go."""
AHEAD, NEAR, FAR = 0.25, 0.13, 0.36
"""[m] How far a foot lands from the one that stands: ahead or back; to its own side, at least and at most."""


def beyond(error: Array, pressure: Array, corners: Array, part: float) -> Array:
    """What (2,) of the capture point's error [m] is more than that part of the pressure's room in `corners` (H, 2)."""
    if error @ error < SLIGHT**2:
        return np.zeros(2)
    wanted = nearest_inside(pressure, corners) + error / part
    return part * (wanted - nearest_inside(wanted, corners))


def reachable(place: Array, stance: Array, side: float) -> Array:
    """The place (x, y, heading) nearest to `place` that a foot on one `side` (1 left, -1 right) of `stance` reaches."""
    c, s = np.cos(stance[2]), np.sin(stance[2])
    away = place[:2] - stance[:2]
    x, y = c * away[0] + s * away[1], side * (c * away[1] - s * away[0])
    x, y = float(np.clip(x, -AHEAD, AHEAD)), side * float(np.clip(y, NEAR, FAR))
    return np.append(turned(stance, x, y, 0.0)[:2], place[2])


def lowered(aside: Array, lift: Array) -> float:
    """How much lower [m] the trunk goes, so that legs reach feet (2, 2) that are aside of their places below it."""
    distance = np.maximum(np.hypot(*aside.T) - UPRIGHT, 0.0)
    return float(max((STRETCH * distance**2 - lift).max(), 0.0))


def approach(state: Array, goal: Array, left: float, tick: float) -> Array:
    """Place, speed and acceleration (3, D) a tick later, on the smoothest way to rest at `goal` (D,) in `left` s."""
    place, speed, acceleration = state
    if left <= tick:
        return np.stack([goal, np.zeros_like(goal), np.zeros_like(goal)])
    d, v, a, h = goal - place, speed * left, acceleration * left**2, tick / left
    third, fourth, fifth = 10.0 * d - 6.0 * v - 1.5 * a, 8.0 * v + 1.5 * a - 15.0 * d, 6.0 * d - 3.0 * v - 0.5 * a
    return np.stack(
        [
            place + h * (v + h * (a / 2.0 + h * (third + h * (fourth + h * fifth)))),
            (v + h * (a + h * (3.0 * third + h * (4.0 * fourth + h * 5.0 * fifth)))) / left,
            (a + h * (6.0 * third + h * (12.0 * fourth + h * 20.0 * fifth))) / left**2,
        ]
    )


def accelerations(state: Array, goal: Array, left: float, times: Array) -> Array:
    """Those (H, D) that `approach` will have at times from now; none before 0 and after it has arrived."""
    place, speed, acceleration = state
    h = np.clip(times / left, 0.0, 1.0)[:, None]
    d, v, a = goal - place, speed * left, acceleration * left**2
    third, fourth, fifth = 10.0 * d - 6.0 * v - 1.5 * a, 8.0 * v + 1.5 * a - 15.0 * d, 6.0 * d - 3.0 * v - 0.5 * a
    there = ((times >= 0.0) & (times < left))[:, None]
    return there * (a + h * (6.0 * third + h * (12.0 * fourth + h * 20.0 * fifth))) / left**2
