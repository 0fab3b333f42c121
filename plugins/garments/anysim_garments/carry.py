"""Carry of cloth: the point that a hand holds goes along an arc to where it is to lie."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim.task.slot_frames import CategoryView
from anysim_garments.cloth import Cloth, Spot
from anysim_garments.grasp import Metres, Speed
from anysim_skills.arm import Arm

Spots = Annotated[tuple[Spot, ...], Field(description="points of the garment that lie where they are to stay")]


class ClothCarry(PhasedSkill):
    """Carry the point `at` of `cloth`, which `robot` holds, to where it is to lie.

    That is `goal`, or over the point `onto` of the same cloth, or where it would be if the cloth lay flat with the
    points `by` where they are, or without any of these as most of it lies. The way is an arc, a half circle where
    `arc` is 1.

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
        goal: Frame | None = None,
        onto: Spot | None = None,
        by: Spots = (),
        arc: Annotated[float, Field(ge=0, le=2, description="height by half the distance")] = 0.8,
        above: Metres = 0.012,
        beyond: Annotated[float, Field(description="[m] that it goes on along its way")] = 0.0,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.2,
    ) -> None:
        """`above` the place the way ends."""
        if (goal is not None) + (onto is not None) + bool(by) > 1 or len(by) == 1:
            raise TaskError(
                "cloth_carry goes to one of `goal: FRAME`, `onto: [U, V]` and `by: [[U, V], [U, V]]`; without any to "
                "where the point would lie as most of the cloth does"
            )
        self.arm, self.cloth = Arm.of(env, robot, tool=tool, solver=solver), Cloth(env.scene, cloth)
        self._goal, self._above, self._beyond, self._arc, self._speed = goal, above, beyond, arc, speed
        self.numbers = np.full(env.num_envs, self.cloth.nearest([at])[0])
        self._onto = None if onto is None else int(self.cloth.nearest([onto])[0])
        self._by = self.cloth.nearest(by) if by else np.zeros(0, dtype=int)
        n = env.num_envs
        self._first, self._last, self._share = np.zeros((n, 7)), np.zeros((n, 3)), np.zeros(n)
        """(N, …) poses where the way begins, places where it ends, and how much of it is done."""
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("carry", self._begin, self._along, 500), Phase("lower", None, self._lower, 100))

    def _begin(self, ids: Array, at: Array) -> None:
        points = self.cloth.state().points[at]
        self._first[ids], self._share[ids] = self.arm.command[ids], 0.0
        if self._goal is not None:
            last = self._goal.position[at]
        elif self._onto is not None:
            last = points[:, self._onto]
        elif len(self._by) == 0:
            last = self.cloth.as_most_lies(points)[np.arange(len(ids)), self.numbers[ids]]
        else:
            last = self.cloth.laid_out(self.numbers[ids], self._by, points)
        way = last[:, :2] - points[np.arange(len(ids)), self.numbers[ids], :2]
        last = last.copy()
        last[:, :2] += self._beyond * way / np.maximum(P.norm(way), 1e-9)[:, None]
        last[:, 2] += self._above
        self._last[ids] = last

    def _along(self, ids: Array, at: Array) -> Array:
        first, last, share = self._first[ids], self._last[ids], self._share[ids]
        way = last - first[:, :3]
        height = self._arc * P.norm(way[:, :2]) / 2
        target = first.copy()
        target[:, :3] += way * ((1 - np.cos(np.pi * share)) / 2)[:, None]
        target[:, 2] += height * np.sin(np.pi * share)
        self.arm.go(ids, target, 2 * self._speed)
        long = np.pi / 2 * np.maximum(P.norm(way), 1e-3)
        self._share[ids] = np.minimum(share + self._speed * self.env.engine.world.physics.control_dt / long, 1.0)
        return self._kept(at, np.where((share >= 1.0) & self.arm.arrived(ids, at, 0.015, 0.15), GO_ON, STAY))

    def _lower(self, ids: Array, at: Array) -> Array:
        target = np.column_stack([self._last[ids], self._first[ids, 3:]])
        self.arm.go(ids, target, self._speed / 2)
        there = self.arm.arrived(ids, at, 0.006, 0.1) | self.arm.touching(ids, at) | (self.steps[ids] >= 80)
        return self._kept(at, np.where(there, GO_ON, STAY))

    def _kept(self, at: Array, said: Array) -> Array:
        return np.where(self.cloth.held_near(self.arm.tool.position)[at], said, _UNSTABLE)


_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
