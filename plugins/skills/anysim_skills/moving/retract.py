"""RetractMoveL: a tool that leaves what it touches straight back, and stops at what is behind it."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY
from anysim_skills.arm import AT_REST, Arm
from anysim_skills.moving.servo import ServoL, ServoLimits

LEAVING = 0.01
"""[m] of the way on which what was touched may hold the tool back."""
PATIENCE, LONG_PATIENCE = 5, 50
"""Control steps at rest after which a tool is held up: on its way, and while it leaves contact."""
NEAR = 0.005
"""[m] from the end of the way at which it is done."""


class RetractMoveL:
    """Draws the tool of one arm back along straight lines, in all envs.

    Attributes:
        blocked: (N,) bool, whether something behind the tool has stopped it since `begin`.
    """

    def __init__(self, arm: Arm, *, speed: float, lead: float = 0.02) -> None:
        """`speed` is in m/s; `lead` [m] bounds the force on what is behind."""
        self.arm, self._lead = arm, lead
        self._servo = ServoL(arm, ServoLimits(speed=speed, lead=lead))
        n = arm.env.num_envs
        self.blocked = np.zeros(n, dtype=bool)
        self._rest = np.zeros(n, dtype=np.int64)
        self._from, self._to = np.zeros((2, n, 7))

    def begin(self, ids: Array, at: Array, back: Array) -> None:
        """From where the tool is, by vectors (n, 3) [m] in the world, with the orientation that it is told to have."""
        self._from[ids] = self.arm.tool.pose[at]
        self._from[ids, 3:] = self.arm.command[ids, 3:]
        self._to[ids] = self._from[ids]
        self._to[ids, :3] += back
        self.blocked[ids], self._rest[ids] = False, 0
        self._servo.begin(ids)

    def step(self, ids: Array, at: Array) -> Array:
        """(n,) STAY under way, GO_ON at the end of the way, the index of `jammed` where something is behind the tool.

        A tool that is held up is told to be where it is: it does not press on.
        """
        arm = self.arm
        self._servo.step(ids, at, self._to[ids])
        tool = arm.tool.position[at]
        still = P.norm(arm.tool.twist[at, :3]) < AT_REST
        pressing = still & (P.norm(arm.command[ids, :3] - tool) > 0.8 * self._lead)
        self._rest[ids] = (self._rest[ids] + 1) * pressing
        gone = P.norm(tool - self._from[ids, :3])
        self.blocked[ids] |= self._rest[ids] > np.where(gone < LEAVING, LONG_PATIENCE, PATIENCE)
        held = ids[self.blocked[ids]]
        arm.command[held, :3] = arm.target[held, :3] = tool[self.blocked[ids]]
        there = P.norm(self._to[ids, :3] - tool) < NEAR
        return np.where(self.blocked[ids], _JAMMED, np.where(there, GO_ON, STAY))


_JAMMED = OUTCOMES.index(Outcome.JAMMED)
