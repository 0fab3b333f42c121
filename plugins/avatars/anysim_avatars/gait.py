"""Walking: the path says where the body goes, the feet say how.

A foot that stands is frozen in the world; the other swings to where the hips will be half a step after it lands. The
hips are as low as both legs need to reach their feet. So nothing slips and no leg is stretched, at any speed.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_avatars.bodies import Proportions

GroundAt = Callable[[Array], Array]
"""Heights (…,) of the ground at points (…, 2) [m]."""
STRETCH = 0.998
"""Share of a leg's length that is used: a straight knee has no side to bend to."""
RATE, BRAKE, TURN, SLOWING = 3.0, 5.0, 2.2, 1.4
"""[m/s^2] of the speed, up and down, [rad/s] of the heading, [m/s^2] before a halt."""
TWIST = 1.1
"""[rad] by which the body turns against a foot, at most."""
FOOT = 4.5
"""[m/s] of a foot in the air, at most; it lands where it is when its time is over."""
IN_PLACE, IN_LINE = 0.03, 0.25
"""[m] and [rad] that a foot may be off its place while the body stands."""


class Legs(NamedTuple):
    """What the gait needs of each avatar (m,) [m]."""

    leg: Array
    ankle: Array
    hip: Array

    @classmethod
    def of(cls, people: list[Proportions], envs: int) -> "Legs":
        """Of the same avatars in several envs."""
        return cls(*(np.tile([getattr(p, key) for p in people], envs) for key in ("leg", "ankle", "hip")))


class Gait(NamedTuple):
    """State of walking (m, …): written in place.

    Attributes:
        pos: (m, 2) of the hips' middle; yaw: (m,); vel: (m, 2).
        feet: (m, 2, 4) x, y, z and heading of each foot; left first.
        swing: (m,) int, the foot in the air, or -1; phase: (m,) of its step.
        lift: (m, 4) where it left the ground.
        hips: (m,) height of the hips above the world's origin.
    """

    pos: Array
    yaw: Array
    vel: Array
    feet: Array
    swing: Array
    phase: Array
    lift: Array
    hips: Array


class Wish(NamedTuple):
    """What a body shall do: velocity (m, 2) [m/s], heading (m,) [rad], and height (m,) and shift (m,) of the hips."""

    vel: Array
    heading: Array
    height: Array
    back: Array


def places(pos: Array, yaw: Array, legs: Legs) -> Array:
    """(m, 2, 2) where the feet belong below a body."""
    left = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1) * (legs.hip * 1.05)[:, None]
    return np.stack([pos + left, pos - left], axis=1)


def step_time(speed: Array) -> Array:
    """Seconds of a step, shorter the faster."""
    return 0.62 - 0.12 * np.minimum(speed, 1.5)


def stand(state: Gait, legs: Legs, ground: Array) -> None:
    """Put the feet below the body, on the ground (m, 2) [m]."""
    state.feet[:, :, :2] = places(state.pos, state.yaw, legs)
    state.feet[:, :, 2], state.feet[:, :, 3] = ground, state.yaw[:, None]
    state.swing[:] = -1
    state.hips[:] = ground.mean(axis=1) + legs.ankle + STRETCH * legs.leg


def carrot(pos: Array, goal: Array, dt: float, limit: Array, ends: Array) -> Array:
    """Velocities (m, 2) towards goals that are reached exactly where they end, at rest."""
    gap = goal - pos
    distance = np.sqrt((gap * gap).sum(-1))
    fastest = np.where(ends, np.sqrt(2 * SLOWING * distance), limit)
    speed = np.minimum(np.minimum(limit, fastest + 0.02), distance / dt)
    return gap / np.maximum(distance, 1e-12)[:, None] * speed[:, None]


def advance(state: Gait, legs: Legs, wish: Wish, ground_at: GroundAt, dt: float) -> None:
    """Go on by dt [s]."""
    _move(state, wish, dt)
    neutral = places(state.pos, state.yaw, legs)
    _step(state, legs, neutral, ground_at, dt)
    _hips(state, legs, wish, dt)


def _move(state: Gait, wish: Wish, dt: float) -> None:
    turn = P.wrapped(wish.heading - state.yaw)
    state.yaw[:] += np.clip(turn * min(1.0, 6.0 * dt), -TURN * dt, TURN * dt)
    for foot in (0, 1):  # a leg does not turn further
        twist = P.wrapped(state.yaw - state.feet[:, foot, 3])
        state.yaw[:] += np.clip(twist, -TWIST, TWIST) - twist
    vel = wish.vel * np.maximum(np.cos(np.clip(turn, -np.pi / 2, np.pi / 2)), 0.0)[:, None] ** 2
    change = vel - state.vel
    size = np.sqrt((change * change).sum(-1))
    slower = (vel * vel).sum(-1) < (state.vel * state.vel).sum(-1)
    share = np.minimum(1.0, np.where(slower, BRAKE, RATE) * dt / np.maximum(size, 1e-12))
    state.vel[:] += change * share[:, None]
    state.pos[:] += state.vel * dt


def _step(state: Gait, legs: Legs, neutral: Array, ground_at: GroundAt, dt: float) -> None:
    rows = np.arange(len(state.pos))
    speed = np.sqrt((state.vel * state.vel).sum(-1))
    off = np.sqrt(((state.feet[:, :, :2] - neutral) ** 2).sum(-1))
    twist = np.abs(P.wrapped(state.feet[:, :, 3] - state.yaw[:, None]))
    wrong = (off > IN_PLACE) | (twist > IN_LINE)
    restless = (speed > 0.03) | wrong.any(axis=1)
    fresh = (state.swing < 0) & restless
    ahead = ((state.feet[:, :, :2] - neutral) * state.vel[:, None]).sum(-1)
    first = np.where(speed > 0.03, ahead.argmin(axis=1), (off + 0.3 * twist).argmax(axis=1))
    state.swing[fresh], state.phase[fresh] = first[fresh], 0.0
    state.lift[fresh] = state.feet[rows[fresh], state.swing[fresh]]
    air = np.flatnonzero(state.swing >= 0)
    if not len(air):
        return
    foot, period = state.swing[air], step_time(speed[air])
    state.phase[air] += dt / period
    phase = np.minimum(state.phase[air], 1.0)
    left = np.where(foot == 0, 1.0, -1.0)[:, None] * np.stack([-np.sin(state.yaw[air]), np.cos(state.yaw[air])], -1)
    later = (1.0 - phase) * period + 0.5 * period
    target = state.pos[air] + left * (legs.hip[air] * 1.05)[:, None] + state.vel[air] * later[:, None]
    ease = phase**3 * (10 - 15 * phase + 6 * phase**2)
    start, feet = state.lift[air], state.feet
    way = start[:, :2] + (target - start[:, :2]) * ease[:, None] - feet[air, foot, :2]
    far = np.sqrt((way * way).sum(-1))
    feet[air, foot, :2] += way * np.minimum(1.0, FOOT * dt / np.maximum(far, 1e-12))[:, None]
    height = ground_at(feet[air, foot, :2])
    feet[air, foot, 3] = start[:, 3] + P.wrapped(state.yaw[air] - start[:, 3]) * ease
    arc = 4 * phase * (1 - phase) * (0.05 + 0.03 * np.minimum(speed[air], 1.5))
    feet[air, foot, 2] = start[:, 2] + (height - start[:, 2]) * ease + arc
    down = air[state.phase[air] >= 1.0]
    other = 1 - state.swing[down]
    goes_on = (speed[down] > 0.03) | wrong[down, other]
    state.phase[down] = np.where(goes_on, state.phase[down] - 1.0, 0.0)
    state.swing[down] = np.where(goes_on, other, -1)
    again = down[goes_on]
    state.lift[again] = feet[again, state.swing[again]]


def _hips(state: Gait, legs: Legs, wish: Wish, dt: float) -> None:
    """The height that was wished, as far as the legs reach; it rises at 0.5 m/s at most."""
    reach = reached_height(state, legs, wish.back)
    target = np.minimum(wish.height, reach)
    rate = 0.6 * dt
    state.hips[:] = np.minimum(state.hips + np.clip(target - state.hips, -1.2 * dt, rate), reach)


def reached_height(state: Gait, legs: Legs, back: Array) -> Array:
    """(m,) the greatest height of the hips at which both legs reach their feet."""
    side = np.stack([-np.sin(state.yaw), np.cos(state.yaw)], axis=-1) * legs.hip[:, None]
    behind = np.stack([np.cos(state.yaw), np.sin(state.yaw)], axis=-1) * back[:, None]
    hips = np.stack([state.pos - behind + side, state.pos - behind - side], axis=1)
    gap = ((state.feet[:, :, :2] - hips) ** 2).sum(-1)
    most = np.sqrt(np.maximum((STRETCH * legs.leg[:, None]) ** 2 - gap, 0.0))
    return (state.feet[:, :, 2] + legs.ankle[:, None] + most).min(axis=1)
