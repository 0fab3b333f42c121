"""Grasp of cloth: a hand comes down on a point of a garment, closes, and lifts it."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim.task.slot_frames import CategoryView
from anysim_garments.cloth import Cloth, Spot
from anysim_matter.pad_grasp import PadGrasp
from anysim_skills.arm import Arm

Metres = Annotated[float, Field(ge=0, description="[m]")]
Speed = Annotated[float, Field(gt=0, description="[m/s] of the tool")]


class ClothGrasp(PadGrasp):
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
        self.cloth = Cloth(env.scene, cloth)
        self.numbers = np.full(env.num_envs, self.cloth.nearest([at])[0])
        arm = Arm.of(env, robot, tool=tool, solver=solver)
        super().__init__(env, arm, above=above, hover=hover, lift=lift, speed=speed)

    @property
    def patient(self) -> bool:
        return self.cloth.pinched

    def point(self, ids: Array, at: Array, above: float) -> Array:
        return self.cloth.aim(self.numbers[ids], self.cloth.state().points[at], above)

    def has(self, ids: Array, at: Array) -> Array:
        return self.cloth.holds(at, self.numbers[ids])

    def keeps(self, at: Array) -> Array:
        return self.cloth.held_near(self.arm.tool.position)[at]
