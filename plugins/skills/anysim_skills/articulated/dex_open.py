"""DexOpen: pull a part open with fingers that are hooked behind the bar of its handle."""

from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.articulated.bar_grasps import hooks
from anysim_skills.articulated.handle import CLEAR, AtHandle, Share, in_world
from anysim_skills.articulated.open import OVERSHOOT, Pulls
from anysim_skills.grasping.dex_grasp import STEEPEST
from anysim_skills.grasping.hand import Hand
from anysim_skills.recovery.homing import Homing

LEVEL = 0.02
"""[m] along the fingers, within which they pass the bar."""
PUSHED_BACK = 0.1
"""Of the range, by which fingers that straighten behind the bar may push the part back."""


class DexOpen(Pulls):
    """Open `part` by its handle with a hand that has several fingers: they go in beside the bar and hook behind it.

    The tool's z is out of the palm and its y along the fingers; `place` is where the middle of the bar is in the tool's
    frame when the fingers close by `synergy`, each until it touches.
    """

    turns: ClassVar[Array] = hooks(np.deg2rad([0.0, 15.0, -15.0]))
    onto: ClassVar[tuple[float, float, float]] = (0.0, 1.0, 0.0)
    closing_steps: ClassVar[int] = 60

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        synergy: str = "power",
        place: Annotated[tuple[float, float, float], Field(description="[m] in the tool's frame")],
        fraction: Share = 0.8,
        **options: object,
    ) -> None:
        self.hand = Hand.of(env, robot)
        self._synergy, self.place = self.hand.named(synergy), place
        self._asked = fraction
        self._fraction = min(1.0 - OVERSHOOT, fraction + PUSHED_BACK)
        self.share = min(1.0, self._fraction + OVERSHOOT)
        super().__init__(env, robot=robot, **options)  # pyright: ignore[reportArgumentType]
        self.movers = (self.arm, self.hand)

    def excluded(self, grasps: Array) -> Array:
        """A hand that comes from below."""
        return in_world(grasps, self.onto)[..., 2] > STEEPEST

    def approach(self, ids: Array, at: Array) -> Array:
        """Along the fingers first, where they would be dragged across the bar."""
        goal, tool = self.at_handle(ids, at, CLEAR), self.arm.tool.position[at]
        onto = in_world(goal, self.onto)
        short = P.dot(goal[:, :3] - tool, onto)
        target = goal.copy()
        target[:, :3] = np.where((short < -LEVEL)[:, None], tool + short[:, None] * onto, goal[:, :3])
        self.arm.go(ids, target, self.speed)
        return np.where((short >= -LEVEL) & self.arm.arrived(ids, at), GO_ON, STAY)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, hand=self.hand, onto=self.onto).phases()

    def leave_handle(self, ids: Array, at: Array) -> None:
        self.hand.open(ids)
        AtHandle.leave_handle(self, ids, at)

    def close(self, ids: Array, at: Array) -> None:
        AtHandle.close(self, ids, at)
        self.hand.close(ids, self._synergy)

    def closing(self, ids: Array, at: Array) -> Array:
        del at
        still = self.hand.closed(ids) & (self.arm.finger_speed(ids) < 0.3)
        return self.fingers.judged(ids, still | (self.steps[ids] >= self.closing_steps), GO_ON)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del env_ids
        return np.where(self.part.joint.opening[at] >= self._asked - 0.02, GO_ON, _MISSED)


_MISSED = OUTCOMES.index(Outcome.MISSED_CONTACT)
