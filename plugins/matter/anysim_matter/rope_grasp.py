"""Grasp of a rope: a hand comes down on a point of it, closes, and lifts it."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim.task.slot_frames import CategoryView
from anysim_matter.cord import Along, Cord
from anysim_matter.held_scoop import Speed
from anysim_skills.arm import Arm

CLOSING = 40
"""Control steps that a hand may take to close."""
RESTING = 0.002
"""[rad/s, m/s] of its fingers, below which they rest."""
Height = Annotated[float, Field(ge=0, description="[m]")]


class RopeGrasp(PhasedSkill):
    """Take hold of `rope` with `robot` at the point `at`, from above, and lift that by `lift`; missed once, again.

    The hand is one of the rope's pads, and turned as it is at home.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        rope: CategoryView,
        at: Along = 1.0,
        tool: str = "tool",
        solver: str = "numba_ik",
        above: Height = 0.004,
        hover: Height = 0.08,
        lift: Height = 0.03,
        speed: Speed = 0.3,
    ) -> None:
        """`above` the point the hand closes."""
        self.arm, self.cord = Arm.of(env, robot, tool=tool, solver=solver), Cord(env.scene, rope)
        self.arm.check_gripper()
        self._number = self.cord.nearest(at)
        self._above, self._hover, self._lift, self._speed = above, hover, lift, speed
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("approach", self._open, self._approach, 300),
            Phase("descend", None, self._descend, 150),
            Phase("close", self._close, self._closing, CLOSING + 1),
            Phase("lift", self._raise, self._rising, 150),
        )

    def retry(self, rung: Rung, env: int) -> int | None:
        return 0 if rung in (Rung.REPLAN, Rung.RESAMPLE) else None

    def _over(self, ids: Array, at: Array, above: float) -> Array:
        """(n, 7) the hand so far above the point."""
        place = self.cord.point(self._number)[at] + np.array([0.0, 0.0, above])
        return np.column_stack([place, self.arm.home(ids)[:, 3:]])

    def _open(self, ids: Array, at: Array) -> None:
        del at
        self.arm.closed[ids] = False

    def _approach(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._over(ids, at, self._hover), self._speed)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.08), GO_ON, STAY)

    def _descend(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._over(ids, at, self._above), self._speed / 2)
        return np.where(self.arm.arrived(ids, at, 0.006, 0.08) | self.arm.touching(ids, at), GO_ON, STAY)

    def _close(self, ids: Array, at: Array) -> None:
        del at
        self.arm.closed[ids] = True
        self.arm.stay(ids)

    def _closing(self, ids: Array, at: Array) -> Array:
        held = self.cord.held_near(self.arm.tool.position)[at]
        still = (self.steps[ids] >= 10) & (self.arm.finger_speed(ids) < RESTING)
        over = (still & ~held) | (self.steps[ids] >= CLOSING)
        return np.where(held & still, GO_ON, np.where(over, _MISSED, STAY))

    def _raise(self, ids: Array, at: Array) -> None:
        del at
        up = np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        self.arm.go(ids, self.arm.command[ids] + up, self._speed / 2)

    def _rising(self, ids: Array, at: Array) -> Array:
        return self.cord.kept(self.arm, at, np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY))


_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)
