"""Stack: objects put on one another, from the bottom to the top."""

from typing import Annotated

from pydantic import Field

from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.grasping.grasp import Force, Metres, Speed
from anysim_skills.grasping.pick_place import PickPlace
from anysim_skills.grasping.tidy import Objects, handles


class Stack(SkillSequence):
    """Put the first of `objects` on `base` with `robot`, and each further one on the one before it."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        objects: Objects,
        base: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        force: Force = None,
        above: Annotated[float, Field(gt=0, description="[m] over the place on the way there and back")] = 0.06,
        tolerance: Annotated[float, Field(gt=0, description="[m] horizontally, once it rests")] = 0.015,
        max_attempts: Annotated[int, Field(ge=1, description="for each object")] = 3,
    ) -> None:
        arm = {"robot": robot, "tool": tool, "solver": solver, "hover": hover, "speed": speed}
        pace = {"above": above, "tolerance": tolerance, "max_attempts": max_attempts, "force": force}
        members: dict[str, PickPlace] = {}
        below = base
        for thing in handles(env, objects):
            members[thing.name] = PickPlace(env, **arm, **pace, object=thing, target=below)
            below = thing.root
        super().__init__(env, members)
