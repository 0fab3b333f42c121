"""MobileServoL and MobileMoveL: base and arm move together, and the tool stays on its line while the base travels.

The arm is told where its tool is to be in the world, and the base goes to a place of its own below it. The base moves
on between two control steps, so inverse kinematics is solved for where it will be, and what the tool is still off by is
added to the command. A tool that strays slows the base down, to a stop at the bound.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY
from anysim_skills.arm import ARRIVED, TURN_RATE, Arm
from anysim_skills.moving.base import GAIN, Base

AHEAD = 2.0
"""Control steps by which the motion of the base is foreseen: one to the next command, one that joints are behind."""
CORRECTION = 0.1
"""Of what the tool is off by, taken into the command in each control step."""
LARGEST = 0.05
"""[m] of that correction."""
RAMP = 25
"""Control steps in which the base takes up its speed."""
SETTLED = 0.02
"""[m], [rad] of the base from its goal."""


class MobileLimits(NamedTuple):
    """How base and tool move.

    Attributes:
        speed: [m/s] of the tool.
        base_speed: [m/s] at most.
        base_rate: [rad/s] at most.
        deviation: [m] that the tool may be off where it is to be; beyond it the move has failed.
    """

    speed: float = 0.2
    base_speed: float = 0.3
    base_rate: float = 0.4
    deviation: float = 0.02


class MobileServoL:
    """Follows targets with the tool of an arm on a base that goes elsewhere meanwhile, in all envs.

    Attributes:
        reference: (N, 7) where the tool is to be now, in the world.
        deviation: (N,) [m] of the tool from there.
    """

    def __init__(self, arm: Arm, base: Base, limits: MobileLimits) -> None:
        """Join an arm with the base that carries it.

        Raises:
            TaskError: the base turns to where it drives.
        """
        if not base.sideways:
            raise TaskError(
                f"the base of '{arm.robot.name}' turns towards where it drives, and would carry the tool off its line; "
                "expected one that moves to all sides, as of holonomic_drive or planar_drive"
            )
        self.arm, self.base, self.limits = arm, base, limits
        n = arm.env.num_envs
        self._dt = arm.env.engine.world.physics.control_dt
        self.reference, self.deviation = np.zeros((n, 7)), np.zeros(n)
        self._correction, self._since = np.zeros((n, 3)), np.zeros(n, dtype=np.int64)

    def begin(self, ids: Array, at: Array) -> None:
        """From where the tool is in these envs; `at` are their rows in the scene."""
        self.reference[ids] = self.arm.tool.pose[at]
        self._correction[ids], self._since[ids], self.deviation[ids] = 0.0, 0, 0.0

    def step(self, ids: Array, at: Array, target: Array, stand: Array) -> Array:
        """(n,) STAY, GO_ON where both have arrived, the index of `controller` where the tool is off by too much.

        Args:
            ids, at: the envs and their rows in the scene.
            target: (n, 7) where the tool is to go, in the world.
            stand: (n, 3) where the base is to go: x, y [m] and yaw [rad].
        """
        arm, limits = self.arm, self.limits
        off = self.reference[ids, :3] - arm.tool.position[at]
        self.deviation[ids] = P.norm(off)
        share = np.clip(2.0 - 2.0 * self.deviation[ids] / limits.deviation, 0.0, 1.0)
        self._since[ids] += 1
        self._drive(ids, at, stand, share * np.minimum(1.0, self._since[ids] / RAMP))
        way = limits.speed * self._dt * share
        self.reference[ids] = P.step_toward(self.reference[ids], target, way, TURN_RATE * way)
        self._correction[ids] = np.clip(self._correction[ids] + CORRECTION * off, -LARGEST, LARGEST)
        command = self.reference[ids]
        command[:, :3] += self._correction[ids]
        arm.go(ids, self._foreseen(at, command), limits.speed)
        arm.command[ids] = arm.target[ids]
        here = P.norm(target[:, :3] - arm.tool.position[at]) < ARRIVED
        left, turn = np.hypot(*(stand - self.base.pose(at))[:, :2].T), P.wrapped(stand - self.base.pose(at))[:, 2]
        there = here & (left < SETTLED) & (np.abs(turn) < SETTLED)
        return np.where(self.deviation[ids] > limits.deviation, _CONTROLLER, np.where(there, GO_ON, STAY))

    def _drive(self, ids: Array, at: Array, stand: Array, share: Array) -> None:
        """A goal of the base that is only so far away that it goes at the share (n,) of its speed."""
        now, limits = self.base.pose(at), self.limits
        way, turn = stand[:, :2] - now[:, :2], P.wrapped(stand[:, 2] - now[:, 2])
        near = share * limits.base_speed / GAIN / np.maximum(P.norm(way), 1e-9)
        most = share * limits.base_rate / GAIN
        target = np.concatenate(
            [now[:, :2] + np.minimum(near, 1.0)[:, None] * way, (now[:, 2] + np.clip(turn, -most, most))[:, None]],
            axis=1,
        )
        self.base.go(ids, target)

    def _foreseen(self, at: Array, command: Array) -> Array:
        """(n, 7) what to command now, so that the tool is at `command` (n, 7) when the base has moved on."""
        now, twist = self.base.frame.pose[at], self.base.frame.twist[at]
        step = AHEAD * self._dt
        turn = step * twist[:, 3:]
        angle = P.norm(turn)
        rotation = P.from_axis_angle(turn / np.maximum(angle, 1e-12)[:, None], angle)
        then = np.concatenate([now[:, :3] + step * twist[:, :3], P.multiply(rotation, now[:, 3:])], axis=1)
        return P.compose(now, P.compose(P.inverse(then), command))


class MobileMoveL:
    """Moves the tool along straight lines to fixed poses while the base goes to a fixed place, in all envs.

    Attributes:
        servo: what follows; its `reference` is on the line, so its `deviation` bounds how far off the line the tool is.
    """

    def __init__(self, arm: Arm, base: Base, limits: MobileLimits) -> None:
        """See `MobileServoL`."""
        self.servo = MobileServoL(arm, base, limits)
        self._target, self._stand = np.zeros((arm.env.num_envs, 7)), np.zeros((arm.env.num_envs, 3))

    def begin(self, ids: Array, at: Array, target: Array, stand: Array) -> None:
        """To tool poses (n, 7) and places of the base (n, 3), as of `MobileServoL.step`."""
        self.servo.begin(ids, at)
        self._target[ids], self._stand[ids] = target, stand

    def step(self, ids: Array, at: Array) -> Array:
        """(n,) as `MobileServoL.step`."""
        return self.servo.step(ids, at, self._target[ids], self._stand[ids])


_CONTROLLER = OUTCOMES.index(Outcome.CONTROLLER)
