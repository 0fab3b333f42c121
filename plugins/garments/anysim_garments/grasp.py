"""Grasp of cloth: a hand comes down on a point of a garment, closes, and lifts it."""

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
from anysim_garments.cloth import Cloth, Spot
from anysim_skills.arm import Arm

CLOSING_STEPS = 40
"""Control steps that a hand may take to close."""
CLOSED = 0.002
"""[rad/s, m/s] of its fingers, below which they rest."""
Metres = Annotated[float, Field(ge=0, description="[m]")]
Speed = Annotated[float, Field(gt=0, description="[m/s] of the tool")]


class ClothGrasp(PhasedSkill):
    """Take hold of `cloth` with `robot` at a point of it, from above, and lift that by `lift`; missed once, again.

    The hand is one of the garment's pads, and turned as it is at home.

    Attributes:
        numbers: (N,) of the point in each env; others may choose it.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        cloth: CategoryView,
        at: Spot,
        tool: str = "tool",
        solver: str = "numba_ik",
        above: Metres = 0.008,
        hover: Metres = 0.08,
        lift: Metres = 0.05,
        speed: Speed = 0.3,
    ) -> None:
        """`above` the point the hand closes."""
        self.arm, self.cloth = Arm.of(env, robot, tool=tool, solver=solver), Cloth(env.scene, cloth)
        self.arm.check_gripper()
        self.numbers = np.full(env.num_envs, self.cloth.nearest([at])[0])
        self._above, self._hover, self._lift, self._speed = above, hover, lift, speed
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("approach", self._open, self._approach, 300),
            Phase("descend", None, self._descend, 150),
            Phase("close", self._close, self._closing, CLOSING_STEPS + 1),
            Phase("lift", self._raise, self._rising, 150),
        )

    def retry(self, rung: Rung, env: int) -> int | None:
        return 0 if rung in (Rung.REPLAN, Rung.RESAMPLE) else None

    def _over(self, ids: Array, at: Array, above: float) -> Array:
        """(n, 7) the hand so far above the point."""
        place = self.cloth.aim(self.numbers[ids], self.cloth.state().points[at], above)
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
        held = self.cloth.holds(at, self.numbers[ids])
        still = (self.steps[ids] >= 10) & (self.arm.finger_speed(ids) < CLOSED)
        missed = still & ~held & (not self.cloth.pinched)  # pads that pinch come after the fingers
        over = missed | (self.steps[ids] >= CLOSING_STEPS)
        return np.where(held & still, GO_ON, np.where(over, _MISSED, STAY))

    def _raise(self, ids: Array, at: Array) -> None:
        del at
        up = np.array([0.0, 0.0, self._lift, 0.0, 0.0, 0.0, 0.0])
        self.arm.go(ids, self.arm.command[ids] + up, self._speed / 2)

    def _rising(self, ids: Array, at: Array) -> Array:
        held = self.cloth.held_near(self.arm.tool.position)[at]
        return np.where(held, np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY), _UNSTABLE)


_MISSED, _UNSTABLE = OUTCOMES.index(Outcome.MISSED_CONTACT), OUTCOMES.index(Outcome.UNSTABLE_GRASP)
