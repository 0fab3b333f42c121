"""Routing of a rope: its held end goes around a post, or is laid down at a goal."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim.task.slot_frames import CategoryView
from anysim_matter.cord import Cord
from anysim_matter.held_scoop import Metres, Speed, Steps
from anysim_skills.arm import Arm

ON = 0.3
"""[rad] that the hand's next place is ahead of it on its way around a post."""


class RopeAround(PhasedSkill):
    """Lead the end of `rope` that `robot` holds around `post`, to its left or right, by `angle` from where it is.

    On the way the hand is `clear` from the post's axis z, and `above` its origin. To the left it goes
    counter-clockwise as seen from above.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        rope: CategoryView,
        post: Frame,
        turn: Literal["left", "right"],
        angle: Annotated[float, Field(gt=0, lt=6.3, description="[rad]")] = 2.6,
        clear: Metres = 0.06,
        above: Annotated[float, Field(description="[m]")] = 0.03,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.15,
        steps: Steps = 400,
    ) -> None:
        self.arm, self.cord, self._post = Arm.of(env, robot, tool=tool, solver=solver), Cord(env.scene, rope), post
        self._sign, self._angle = 1.0 if turn == "left" else -1.0, angle
        self._clear, self._above, self._speed, self._late = clear, above, speed, steps
        self._begun, self._done = np.zeros((2, env.num_envs))
        """(N,) [rad] where the hand was as seen from the post, and how far it has come around it."""
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("beside", self._begin, self._beside, self._late), Phase("around", None, self._around, self._late))

    def _seen(self, at: Array) -> Array:
        """(n,) [rad] where the hand is as seen from the post."""
        away = self.arm.tool.position[at] - self._post.position[at]
        return np.arctan2(away[:, 1], away[:, 0])

    def _begin(self, ids: Array, at: Array) -> None:
        self._begun[ids], self._done[ids] = self._seen(at), 0.0

    def _place(self, ids: Array, at: Array, angle: Array) -> Array:
        """(n, 7) the hand beside the post at angles (n,) [rad]."""
        out = self._clear * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        place = self._post.position[at] + np.column_stack([out, np.full(len(ids), self._above)])
        return np.column_stack([place, self.arm.command[ids, 3:]])

    def _beside(self, ids: Array, at: Array) -> Array:
        """To the side on which it passes, a tangent's way: never over the post."""
        aside = np.minimum(self._angle, np.pi / 2)
        goal = self._place(ids, at, self._begun[ids] + self._sign * aside)
        self.arm.go(ids, goal, self._speed)
        return self.cord.kept(self.arm, at, np.where(self.arm.arrived(ids, at, 0.015, 0.15), GO_ON, STAY))

    def _around(self, ids: Array, at: Array) -> Array:
        come = self._sign * (self._seen(at) - self._begun[ids])
        come = (come + 1.0) % (2 * np.pi) - 1.0  # from a bit before where it began
        self._done[ids] = np.maximum(self._done[ids], come)
        ahead = np.minimum(self._done[ids] + ON, self._angle)
        self.arm.go(ids, self._place(ids, at, self._begun[ids] + self._sign * ahead), self._speed)
        there = (ahead >= self._angle) & self.arm.arrived(ids, at, 0.015, 0.15)
        return self.cord.kept(self.arm, at, np.where(there, GO_ON, STAY))


class RopeLay(PhasedSkill):
    """Lay the point of `rope` that `robot` holds down at `goal`, along a straight line and from `above` it down."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        rope: CategoryView,
        goal: Frame,
        above: Metres = 0.03,
        lowest: Annotated[float, Field(description="[m] of the hand over the goal at the end")] = 0.01,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.15,
        steps: Steps = 400,
    ) -> None:
        self.arm, self.cord, self._goal = Arm.of(env, robot, tool=tool, solver=solver), Cord(env.scene, rope), goal
        self._above, self._lowest, self._speed, self._late = above, lowest, speed, steps
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("carry", None, self._carry, self._late), Phase("lower", None, self._lower, 100))

    def _over(self, ids: Array, at: Array, above: float) -> Array:
        place = self._goal.position[at] + np.array([0.0, 0.0, above])
        return np.column_stack([place, self.arm.command[ids, 3:]])

    def _carry(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._over(ids, at, self._above), self._speed)
        return self.cord.kept(self.arm, at, np.where(self.arm.arrived(ids, at, 0.015, 0.15), GO_ON, STAY))

    def _lower(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._over(ids, at, self._lowest), self._speed / 2)
        there = self.arm.arrived(ids, at, 0.006, 0.1) | self.arm.touching(ids, at) | (self.steps[ids] >= 80)
        return self.cord.kept(self.arm, at, np.where(there, GO_ON, STAY))
