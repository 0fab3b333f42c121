"""The trot: when each foot stands and swings, and where it goes, in the base frame. Elementwise over envs and legs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError

MOST_SLIP = 0.3
"""Bound of `Trot.slip`, as a share of the command's limits: a robot that pushes against a wall does not run away."""


@dataclass(frozen=True)
class GaitParameters:
    """How a robot trots.

    Frequency of strides [1/s], clearance [m] of a swinging foot, share of a stride on the ground (`duty`), and the
    gains of the feedbacks that `TrotController` explains: `placement` [s], `levelling`, `tracking` [1/s].
    """

    frequency: float
    clearance: float
    duty: float
    placement: float
    levelling: float
    tracking: float
    in_place: bool


class Motion(NamedTuple):
    """What the gait is told of the body (E,): in the base's heading frame, measured."""

    velocity: Array
    """(E, 3) [m/s, m/s, rad/s] forward, left, turn"""
    roll: Array
    pitch: Array


class FootTargets(NamedTuple):
    """What the gait asks for: places (E, L, 3) [m] and velocities (E, L, 3) [m/s] of feet, and which stand (E, L)."""

    feet: Array
    velocity: Array
    stance: Array


class Trot:
    """Diagonal pairs of feet step in turn.

    Stance feet move against the body; swinging feet go to where half of a
    stance at the commanded velocity brings them back to their nominal places. Positions are where feet shall be at the
    end of a tick.

    Attributes:
        nominal: (L, 3) [m] where the feet are when the robot stands.
        velocity: (N, 3) the commanded velocity as ramped: m/s forward, m/s left, rad/s.
        slip: (N, 3) what the feet are told beyond it, because the body was slower or faster than commanded.
    """

    def __init__(self, nominal: Array, num_envs: int, limits: Array, ramp: float, parameters: GaitParameters) -> None:
        """`limits` (3,) of the command, reached from zero in the time `ramp` [s]."""
        quadrants = {(bool(x > 0), bool(y > 0)) for x, y in nominal[:, :2]}
        if len(nominal) != 4 or len(quadrants) != 4:
            raise TaskError(
                f"a trot needs four legs, one at each corner of the base; got {len(nominal)} with feet at "
                f"{np.round(nominal[:, :2], 3).tolist()} (x, y) [m]"
            )
        self.nominal, self._p = nominal, parameters
        self._ramp, self._most = limits / ramp, MOST_SLIP * limits
        self._offset = np.where(nominal[:, 0] * nominal[:, 1] > 0, 0.0, 0.5)
        n, legs = num_envs, len(nominal)
        self.velocity, self.slip = np.zeros((n, 3)), np.zeros((n, 3))
        self._phase, self._idle = np.zeros(n), np.zeros(n)
        self._foot, self._lifted = np.zeros((n, legs, 3)), np.zeros((n, legs, 3))
        self._landed, self._stance = np.zeros((n, legs, 3)), np.ones((n, legs), dtype=bool)

    def reset(self, rows: Array, feet: Array) -> None:
        """The feet (E, L, 3) of these envs stand there, and the robots stand still."""
        self.velocity[rows] = self.slip[rows] = 0.0
        self._phase[rows] = 0.0
        self._idle[rows] = 2.0
        self._foot[rows] = self._lifted[rows] = self._landed[rows] = feet
        self._stance[rows] = True

    def tick(self, rows: slice | Array, command: Array, motion: Motion, dt: float) -> FootTargets:
        """Advance by `dt` towards commands (E, 3)."""
        p = self._p
        velocity = self.velocity[rows]
        velocity = velocity + np.minimum(np.maximum(command - velocity, -self._ramp * dt), self._ramp * dt)
        phase, walking = self._advance(rows, command, velocity, dt)
        slip = self.slip[rows] + p.tracking * dt * (velocity - motion.velocity)
        slip = np.where(walking[:, None], np.minimum(np.maximum(slip, -self._most), self._most), 0.0)
        pace = velocity + slip
        local = (phase[:, None] + self._offset) % 1.0
        stance = (local < p.duty) | ~walking[:, None]
        was, before = self._stance[rows], self._foot[rows]

        ground = self._ground(before, motion)
        planted = np.where((stance & ~was)[..., None], self._landed[rows], before)
        since = np.where(was, dt, local / p.frequency)  # a foot has stood since its phase was 0
        sliding = _against(pace, planted) * walking[:, None, None]
        planted = planted + sliding * since[..., None]
        lifted = np.where((was & ~stance)[..., None], before, self._lifted[rows])
        landing = self._landing(velocity, pace, motion)
        swung = np.minimum(np.maximum((local - p.duty) / (1.0 - p.duty), 0.0), 1.0)
        share = swung - np.sin(2.0 * np.pi * swung) / (2.0 * np.pi)
        flying = lifted + (landing - lifted) * share[..., None]

        foot = np.where(stance[..., None], planted, flying)
        turn = np.cos(2.0 * np.pi * swung)
        bump = 0.5 * p.clearance * (1.0 - turn)
        # Standing legs push the low side up; swinging feet follow the ground, so that they neither scuff nor stamp.
        tilt = np.where(stance, -p.levelling * ground, ground)
        foot[..., 2] = self.nominal[:, 2] + np.where(stance, 0.0, bump) + tilt
        # Of the plan alone: the rates of measured tilts and drifts would feed noise to the drives.
        rate = p.frequency / (1.0 - p.duty)
        speed = np.where(stance[..., None], sliding, (landing - lifted) * (rate * (1.0 - turn))[..., None])
        speed[..., 2] = np.where(stance, 0.0, rate * np.pi * p.clearance * np.sin(2.0 * np.pi * swung))
        targets = FootTargets(foot, speed, stance)
        self.velocity[rows], self.slip[rows] = velocity, slip
        self._phase[rows], self._stance[rows] = phase, stance
        self._lifted[rows], self._landed[rows], self._foot[rows] = lifted, landing, foot
        return targets

    def _advance(self, rows: slice | Array, command: Array, velocity: Array, dt: float) -> tuple[Array, Array]:
        """The phase (E,) of the stride, and who walks: until a whole stride was made without a command to move."""
        phase, idle, step = self._phase[rows], self._idle[rows], self._p.frequency * dt
        moving = ((command != 0.0) | (velocity != 0.0)).any(axis=1) | self._p.in_place
        idle = np.where(moving, 0.0, np.minimum(idle + step, 2.0))
        halves = np.floor(2.0 * (phase + step))  # at each half of a stride, all feet stand
        stops = (idle >= 1.0) & (halves > np.floor(2.0 * phase))
        standing = (idle >= 1.0) & self._stance[rows].all(axis=1) & (phase % 0.5 == 0.0)
        advanced = np.where(stops, 0.5 * halves, phase + step) % 1.0
        self._idle[rows] = idle
        return np.where(standing, phase, advanced), ~standing

    def _ground(self, feet: Array, motion: Motion) -> Array:
        """(E, L) [m] how much higher than the plane of the base the ground is at the feet, as the base is tilted."""
        return motion.pitch[:, None] * feet[..., 0] - motion.roll[:, None] * feet[..., 1]

    def _landing(self, velocity: Array, pace: Array, motion: Motion) -> Array:
        """(E, L, 3) [m] where swinging feet land."""
        half = 0.5 * self._p.duty / self._p.frequency
        landing = self.nominal - _against(pace, np.tile(self.nominal, (len(pace), 1, 1))) * half
        landing[..., :2] += self._p.placement * (motion.velocity - velocity)[:, None, :2]
        return landing

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, rows: Array) -> dict[str, Array]:
        """Copies of all that the next tick depends on."""
        return {name.strip("_"): getattr(self, name)[rows] for name in _STATE}

    def restore(self, rows: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        for name in _STATE:
            getattr(self, name)[rows] = data[name.strip("_")]


_STATE = ("velocity", "slip", "_phase", "_idle", "_foot", "_lifted", "_landed", "_stance")


def _against(velocity: Array, feet: Array) -> Array:
    """(E, L, 3) [m/s] how points fixed to the ground move in the frame of a base that moves at (E, 3)."""
    vx, vy, turn = (velocity[:, None, k] for k in range(3))
    return np.stack([turn * feet[..., 1] - vx, -turn * feet[..., 0] - vy, np.zeros_like(feet[..., 0])], axis=-1)
