"""Drag: grasp an object, and slide it across its support to a goal without lifting it."""

from typing import Annotated

from pydantic import Field

from anysim.skills.base import Outcome
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.moving.slide import Slide


class Drag(SkillSequence):
    """Grasp `object` with `robot` where it lies and slide it to `goal`, horizontally; what is lost is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        hover: Metres = 0.1,
        tolerance: Metres = 0.01,
        speed: Speed = 0.4,
        force: Force = None,
        slide_speed: Speed = 0.12,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
    ) -> None:
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver, "speed": speed}
        slide = Slide(env, **arm, goal=goal, tolerance=tolerance, slide_speed=slide_speed)
        members = {"grasp": Grasp(env, slide, **arm, force=force, offset=offset, hover=hover, lift=0.0), "slide": slide}
        again = {("slide", why): "grasp" for why in (Outcome.UNSTABLE_GRASP, Outcome.LOST)}
        super().__init__(env, members, back=again, max_attempts=max_attempts)
