"""Which foot goes where and when, and where the centre of pressure is meanwhile, for every env.

A step begins with both feet on the ground while the pressure moves from the foot behind to the one that will carry
(`double` s), then the other foot swings (`single` s). What a step does is decided a step ahead, so that the centre of
mass can prepare for it. Places are (x, y, heading) in the plan's frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim_legged.catch import (
    FASTEST,
    LEAD,
    QUICKENING,
    SETTLED,
    SLOWEST,
    SWIFTEST,
    accelerations,
    approach,
    reachable,
)
from anysim_legged.support import turned

STANDING, STEPPING = 0, 1
CORRECTION = np.array([0.03, 0.03, 0.05])
"""How far a step goes, beyond what it was to do, to where it would land had no foot ever slipped [m, m, rad]."""


@dataclass(frozen=True)
class Gait:
    """Times of a step [s], how high a foot is lifted [m], and how a walk begins."""

    double: float
    single: float
    clearance: float
    lead: float
    """From the wish to walk to the first shift of weight: what the preview needs to see it coming."""
    width: float
    """Between the feet [m]."""

    @property
    def period(self) -> float:
        """Of a step."""
        return self.double + self.single


class Feet(NamedTuple):
    """What the feet do now."""

    places: Array
    """(2, 3)."""
    lift: Array
    """(2,) of the soles [m]."""
    standing: tuple[bool, bool]


class Footsteps:
    """Plans of all envs."""

    def __init__(self, gait: Gait, tick: float, num_envs: int, swing: Array) -> None:
        """`swing` (2, 2, 3): what an acceleration of the left and the right foot adds to the pressure [s^2]."""
        self._gait, self._tick, self._swing = gait, tick, swing
        self._mode = np.zeros(num_envs, dtype=np.int64)
        self._stance = np.zeros(num_envs, dtype=np.int64)
        self._time = np.zeros(num_envs)
        """Since this step, or this stand, began [s]."""
        self._double = np.zeros(num_envs)
        """How long this step's double support takes; the pressure moves in the last `gait.double` of it."""
        self._feet = np.zeros((num_envs, 2, 3))
        self._target = np.zeros((num_envs, 3))
        """Where the swinging foot lands."""
        self._from = np.zeros((num_envs, 2))
        """Where the pressure was when this step, or this stand, began."""
        self._next = np.zeros((num_envs, 3))
        """The command that the step after this one obeys."""
        self._path = np.zeros((num_envs, 3))
        """Where the middle of the feet would be in the world, after the step that lands next, had none slipped."""
        self._lead = np.zeros((num_envs, 3))
        self._rate = np.ones(num_envs)
        """How much faster than others this step is."""
        self._hasty = np.zeros(num_envs, dtype=bool)
        """Whether there is a next one, as fast."""
        self._shift = np.zeros((num_envs, 2))
        """How far from `target` the swinging foot lands, to catch the robot [m]."""
        self._aside = np.zeros((num_envs, 3, 2))
        """How far it is on that way, with speed and acceleration."""

    def begin(self, env: int, places: Array) -> None:
        """The env stands with its feet there."""
        self._mode[env], self._time[env] = STANDING, 10.0
        self._feet[env] = places
        self._from[env] = places[:, :2].mean(axis=0)
        self._double[env], self._next[env], self._lead[env] = 0.0, 0.0, 0.0
        self._path[env] = turned(places[1], 0.0, self._gait.width / 2.0, 0.0)
        self._rate[env], self._hasty[env], self._shift[env], self._aside[env] = 1.0, False, 0.0, 0.0

    def advance(self, env: int, command: Array, middles: Array, lead: Array) -> None:
        """A tick later.

        Args:
            env: which.
            command: (vx, vy, turn rate).
            middles: (2, 2) the feet's centres of pressure now.
            lead: (3,) place and heading of the world in the plan's frame.
        """
        gait = self._gait
        self._lead[env] = lead
        self._time[env] += self._rate[env] * self._tick
        moving = bool(np.abs(command).max() > 1e-3)
        if self._mode[env] == STANDING:
            if moving and self._time[env] > gait.period:
                self._next[env] = command
                self._from[env] = middles.mean(axis=0)
                self._step(env, 1 if command[1] >= 0.0 else 0, gait.lead + gait.double, command)
        elif self._time[env] >= self._double[env] + gait.single - 1e-9:
            landed = 1 - int(self._stance[env])
            last = not self._hasty[env]
            self._land(env, landed)
            self._from[env] = middles[self._stance[env]]
            if last and not self._next[env].any() and self._parallel(self._feet[env]):
                self._mode[env], self._time[env], self._double[env] = STANDING, 0.0, gait.double
            else:
                self._step(env, landed, gait.double, command)
        elif self._shift[env].any() and self._time[env] > self._double[env]:
            self._aside[env] = approach(self._aside[env], self._shift[env], self._left(env) + self._tick, self._tick)

    def _land(self, env: int, foot: int) -> None:
        self._feet[env, foot] = self._target[env]
        if self._shift[env].any():
            self._feet[env, foot, :2] += self._shift[env]
            x, y = self._shift[env]
            self._path[env, :2] += turned(np.array([0.0, 0.0, -self._lead[env, 2]]), x, y, 0.0)[:2]
        self._rate[env] = self._rate[env] if self._hasty[env] else 1.0
        self._hasty[env], self._shift[env], self._aside[env] = False, 0.0, 0.0

    def catches(self, env: int) -> bool:
        """Whether the foot that swings, or will, may still be sent elsewhere."""
        return self._mode[env] == STEPPING and self._left(env) > SETTLED

    def stands(self, env: int) -> bool:
        """Whether no step is under way."""
        return self._mode[env] == STANDING

    def start(self, env: int, stance: int, middles: Array, command: Array) -> None:
        """Begin to step at once, from standing on both feet, with one that stays."""
        self._from[env], self._next[env] = middles.mean(axis=0), 0.0
        self._step(env, stance, LEAD + self._gait.double, command)

    def rates(self, env: int) -> list[float]:
        """How fast this step may go on, with what it does now as the first."""
        rate = float(self._rate[env])
        return [rate, max(rate - QUICKENING, SLOWEST), min(rate + QUICKENING, FASTEST)]

    def pace(self, env: int, rate: float) -> None:
        """Go on with this step, and with another after it, so much faster than others."""
        self._rate[env], self._hasty[env] = rate, True

    def landing(self, env: int, by: Array) -> tuple[Array, Array]:
        """The shift (2,) nearest to `by` (2,) more than now that the foot can make; how much more (2,) it is."""
        stance, place = int(self._stance[env]), self._target[env].copy()
        at, speed, _ = self._aside[env]
        left = self._left(env)
        middle = at + 0.5 * left * speed  # where it would come to rest with an even deceleration
        away = self._shift[env] + by - middle
        most = SWIFTEST * left**2 / 5.77  # of the smoothest way, whose largest acceleration is 5.77 d / t^2
        place[:2] += middle + away * min(1.0, most / max(float(np.hypot(*away)), 1e-9))
        shift = reachable(place, self._feet[env, stance], 1.0 if stance == 1 else -1.0)[:2] - self._target[env, :2]
        return shift, shift - self._shift[env]

    def send(self, env: int, shift: Array) -> None:
        """Have the swinging foot land (2,) aside of its place, and the next beside it."""
        self._shift[env], self._next[env] = shift, 0.0

    def _left(self, env: int) -> float:
        """[s] that the swinging foot has, or will have, until it lands."""
        gait = self._gait
        return float(min(self._double[env] + gait.single - self._time[env], gait.single) / self._rate[env])

    def _step(self, env: int, stance: int, double: float, command: Array) -> None:
        self._mode[env], self._stance[env] = STEPPING, stance
        self._time[env], self._double[env] = 0.0, double
        self._target[env] = self._landing(self._feet[env, stance], stance, self._next[env])
        if self._next[env].any():
            vx, vy, rate = self._next[env] * self._gait.period
            self._path[env] = turned(self._path[env], vx, vy, rate)
            wanted = turned(turned(self._lead[env], *self._path[env]), 0.0, self._half(stance), 0.0)
            miss = wanted - self._target[env]
            miss[2] = P.wrapped(miss[2])
            self._target[env] += np.clip(miss, -CORRECTION, CORRECTION)
        self._next[env] = command if np.abs(command).max() > 1e-3 else 0.0

    def _landing(self, stance: Array, side: int, command: Array) -> Array:
        """Where the other foot lands, for a stance foot 0 (left) or 1 (right) at a place."""
        half = self._half(side)
        middle = turned(stance, 0.0, half, 0.0)
        vx, vy, rate = command * self._gait.period
        return turned(turned(middle, vx, vy, rate), 0.0, half, 0.0)

    def _half(self, stance: int) -> float:
        """From the middle of the feet to the one that swings, to the left [m]."""
        return self._gait.width / 2.0 * (-1.0 if stance == 0 else 1.0)

    def planned(self, env: int, place: Array) -> Array:
        """Where a place (2,) of the plan would be in the world, had no foot ever slipped."""
        stance = int(self._stance[env])
        own = self._target[env] if self._mode[env] == STEPPING else self._feet[env, 1 - stance]
        middle = turned(own, 0.0, -self._half(stance), 0.0)
        away = place - middle[:2]
        c, s = np.cos(middle[2]), np.sin(middle[2])
        return turned(self._path[env], c * away[0] + s * away[1], c * away[1] - s * away[0], 0.0)[:2]

    def _parallel(self, feet: Array) -> bool:
        return bool(np.abs(self._landing(feet[1], 1, np.zeros(3)) - feet[0]).max() < 0.002)

    def now(self, env: int) -> Feet:
        """Places and lifts at this time."""
        places, lift = self._feet[env].copy(), np.zeros(2)
        since = self._time[env] - self._double[env]
        if self._mode[env] == STANDING or since <= 0.0:
            return Feet(places, lift, (True, True))
        swing = 1 - int(self._stance[env])
        s = min(since / self._gait.single, 1.0)
        smooth = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        places[swing] += smooth * (self._target[env] - places[swing])
        places[swing, :2] += self._aside[env, 0]
        lift[swing] = self._gait.clearance * 64.0 * (s * (1.0 - s)) ** 3
        return Feet(places, lift, (swing == 1, swing == 0))

    def pressure(self, env: int, command: Array, times: Array, offset: Array, further: float = 0.0) -> Array:
        """The pressure (H, 2) that the pendulum is to have at times from now, if the command (3,) stays.

        It is where the feet want it less what swinging legs add, so that their sum stays in the middle of the soles:
        a leg that is flung forward carries the trunk along, instead of the toes holding it back.

        Args:
            env: which.
            command: (vx, vy, turn rate).
            times: (H,) [s].
            offset: (2, 2) of the centre of pressure in each foot's place when it carries alone.
            further: [m] along x and y, how much further than planned the swinging foot lands.
        """
        gait, now, rate = self._gait, float(self._time[env]), float(self._rate[env])
        ahead, horizon = now + times, float(times[-1])
        hasty = bool(self._hasty[env])
        if rate != 1.0:
            left = float(self._double[env]) + gait.single - now + hasty * gait.period
            ahead = np.where(rate * times < left, now + rate * times, now + left + times - left / rate)
            horizon = float(ahead[-1]) - now
        feet = self._feet[env].copy()
        knots, points = [0.0], [self._from[env]]
        clock, double = 0.0, float(self._double[env])
        stance, mode, target, coming = int(self._stance[env]), int(self._mode[env]), self._target[env], self._next[env]
        added = np.zeros((len(times), 2))
        shift = self._shift[env] + further
        if mode == STEPPING and shift.any():
            start = max(double - now, 0.0) / rate
            more = accelerations(self._aside[env], shift, self._left(env), times - start)
            added += self._turned(1 - stance, feet[1 - stance], more)
        while True:
            middles = np.array([turned(feet[k], float(offset[k, 0]), float(offset[k, 1]), 0.0)[:2] for k in range(2)])
            end = middles.mean(axis=0) if mode == STANDING else middles[stance]
            knots += [clock + max(double - gait.double, 0.0), clock + double]
            points += [points[-1], end]
            if mode == STEPPING:
                added += rate**2 * self._added(1 - stance, feet[1 - stance], target, ahead - clock - double)
            clock += double + gait.single
            knots.append(clock)
            points.append(end)
            if mode == STANDING or clock - now > horizon:
                break
            feet[1 - stance] = target
            feet[1 - stance, :2] += shift
            shift = np.zeros(2)
            if not hasty and not coming.any() and self._parallel(feet):
                mode, double = STANDING, gait.double
                continue
            rate, hasty = rate if hasty else 1.0, False
            stance, double = 1 - stance, gait.double
            target = self._landing(feet[stance], stance, coming)
            coming = command if np.abs(command).max() > 1e-3 else np.zeros(3)
        at, where = np.array(knots), np.array(points)
        return np.stack([np.interp(ahead, at, where[:, k]) for k in range(2)], axis=1) - added

    def _added(self, side: int, start: Array, target: Array, since: Array) -> Array:
        """What a foot that swings from one place to another adds to the pressure (H, 2), at times since it left."""
        gait = self._gait
        s = np.clip(since / gait.single, 0.0, 1.0)
        u, slope = s * (1.0 - s), 1.0 - 2.0 * s
        along = 60.0 * u * slope / gait.single**2
        up = gait.clearance * 64.0 * 6.0 * u * (slope**2 - u) / gait.single**2
        c, n = np.cos(start[2]), np.sin(start[2])
        away = target[:2] - start[:2]
        x, y = c * away[0] + n * away[1], c * away[1] - n * away[0]
        shift = np.stack([along * x, along * y, up], axis=1) @ self._swing[side].T
        return np.stack([c * shift[:, 0] - n * shift[:, 1], n * shift[:, 0] + c * shift[:, 1]], axis=1)

    def _turned(self, side: int, start: Array, more: Array) -> Array:
        """What accelerations (H, 2) of a foot in the plane add to the pressure (H, 2)."""
        c, s = np.cos(start[2]), np.sin(start[2])
        turn = np.array([[c, -s], [s, c]])
        return more @ turn @ self._swing[side, :, :2].T @ turn.T

    def _arrays(self) -> dict[str, Array]:
        return {
            "mode": self._mode,
            "stance": self._stance,
            "time": self._time,
            "double": self._double,
            "places": self._feet,
            "target": self._target,
            "from": self._from,
            "next": self._next,
            "path": self._path,
            "lead": self._lead,
            "rate": self._rate,
            "hasty": self._hasty,
            "shift": self._shift,
            "aside": self._aside,
        }

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of the plans."""
        return {f"step.{name}": values[env_ids].copy() for name, values in self._arrays().items()}

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        for name, values in self._arrays().items():
            values[env_ids] = data[f"step.{name}"]
