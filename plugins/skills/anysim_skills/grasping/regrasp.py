"""Regrasp: put a held object down, and grasp it again elsewhere."""

from typing import Annotated

from pydantic import Field

from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.grasping.place import Place


class Regrasp(SkillSequence):
    """Put the held `object` down on `target`, and grasp it again at `offset` from its origin; then lift it."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        target: Frame,
        offset: Offset = (0.0, 0.0, 0.0),
        lift: Annotated[float, Field(ge=0, description="[m]; 0 leaves that to the next skill")] = 0.1,
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        force: Force = None,
        tolerance: Annotated[float, Field(gt=0, description="[m] horizontally, once it rests")] = 0.03,
    ) -> None:
        """An object that is lost on the way is grasped where it lies."""
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver, "speed": speed}
        members = {
            "put down": Place(env, **arm, target=target, retreat=hover, tolerance=tolerance),
            "grasp": Grasp(env, **arm, force=force, offset=offset, hover=hover, lift=lift),
        }
        super().__init__(env, members, optional=["put down"])
