"""Grasp of a rope: a hand comes down on a point of it, closes, and lifts it."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim.task.slot_frames import CategoryView
from anysim_matter.cord import Along, Cord
from anysim_matter.held_scoop import Speed
from anysim_matter.pad_grasp import PadGrasp
from anysim_skills.arm import Arm

Height = Annotated[float, Field(ge=0, description="[m]")]


class RopeGrasp(PadGrasp):
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
        self.cord = Cord(env.scene, rope)
        self._number = self.cord.nearest(at)
        arm = Arm.of(env, robot, tool=tool, solver=solver)
        super().__init__(env, arm, above=above, hover=hover, lift=lift, speed=speed)

    def point(self, ids: Array, at: Array, above: float) -> Array:
        return self.cord.point(self._number)[at] + np.array([0.0, 0.0, above])

    def has(self, ids: Array, at: Array) -> Array:
        return self.keeps(at)

    def keeps(self, at: Array) -> Array:
        return self.cord.held_near(self.arm.tool.position)[at]
