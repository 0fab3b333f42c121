"""Hanging of cloth: what a hand holds is drawn over a rail until it lies over it."""

from collections.abc import Sequence

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim.task.slot_frames import CategoryView
from anysim_garments.cloth import Cloth
from anysim_garments.grasp import Metres, Speed
from anysim_skills.arm import Arm


class ClothHang(PhasedSkill):
    """Draw `cloth`, which `robot` holds at an edge, over a rail along the axis x of `rail`, and hold it there.

    The hand goes up to `clear` above the rail, across it, and `beyond` it down to `over` above it.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        cloth: CategoryView,
        rail: Frame,
        clear: Metres = 0.12,
        beyond: Metres = 0.15,
        over: Metres = 0.03,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.25,
    ) -> None:
        self.arm, self.cloth, self._rail = Arm.of(env, robot, tool=tool, solver=solver), Cloth(env.scene, cloth), rail
        self._clear, self._beyond, self._over, self._speed = clear, beyond, over, speed
        self._begun = np.zeros((env.num_envs, 7))
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("rise", self._begin, self._rise, 300),
            Phase("across", None, self._across, 400),
            Phase("down", None, self._down, 200),
        )

    def _begin(self, ids: Array, at: Array) -> None:
        del at
        self._begun[ids] = self.arm.command[ids]

    def _target(self, ids: Array, at: Array, beyond: float | None, height: float) -> Array:
        """(n, 7) a hand beyond the rail [m], as seen from where it was; over where it began if None."""
        rail, target = self._rail.pose[at], self._begun[ids].copy()
        seen = P.rotate_inverse(rail[:, 3:], target[:, :3] - rail[:, :3])
        if beyond is not None:
            seen[:, 1] = -np.sign(seen[:, 1]) * beyond
            target[:, :3] = rail[:, :3] + P.rotate(rail[:, 3:], seen)
        target[:, 2] = rail[:, 2] + height
        return target

    def _rise(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._target(ids, at, None, self._clear), self._speed)
        return self._kept(ids, at, 0.02)

    def _across(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._target(ids, at, self._beyond, self._clear), self._speed)
        return self._kept(ids, at, 0.02)

    def _down(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._target(ids, at, self._beyond, self._over), self._speed)
        return self._kept(ids, at, 0.01)

    def _kept(self, ids: Array, at: Array, within: float) -> Array:
        said = np.where(self.arm.arrived(ids, at, within, 0.15), GO_ON, STAY)
        return np.where(self.cloth.held_near(self.arm.tool.position)[at], said, _UNSTABLE)


_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
