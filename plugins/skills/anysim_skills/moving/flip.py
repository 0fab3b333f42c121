"""Flip: throw a rocker switch, on or off, and let go of it."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim.task.joints import RangedJointView
from anysim.task.scene import RobotView
from anysim_skills.grasping.grasp import Speed
from anysim_skills.moving.press import Press
from anysim_skills.planning import LATENCY, Latency, PlannerName


class Flip(Press):
    """Throw the switch `part` by pressing its frame `<part>.on`, or `<part>.off`, with the closed fingers of `robot`.

    It is on at the upper end of its range.
    """

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        part: RangedJointView,
        on: Annotated[bool, Field(description="false throws it back")] = True,
        tool: str = "tool",
        solver: str = "numba_ik",
        fraction: Annotated[float, Field(gt=0, le=1, description="of the joint's range that counts as thrown")] = 0.93,
        speed: Speed = 0.3,
        press_speed: Speed = 0.08,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        self._on = on
        button = env.scene.frame(f"{part.name}.{'on' if on else 'off'}")
        arm = {"robot": robot, "tool": tool, "solver": solver, "planner": planner, "latency": latency}
        arm |= {"speed": speed, "press_speed": press_speed}
        super().__init__(env, button=button, part=part, fraction=fraction, **arm)

    def pressed(self, at: Array) -> Array:
        opening = self._part.opening[at]
        return np.where(self._on, opening, 1.0 - opening) >= self._fraction
