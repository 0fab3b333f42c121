"""Unplug: pull an object out of its hole, and put it down."""

from typing import Annotated

from pydantic import Field

from anysim.skills.base import Outcome
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.grasping.place import Place
from anysim_skills.insertion.pull_out import Lead, PullOut


class Unplug(SkillSequence):
    """Pull `object` out of its hole with `robot`, and put it down on `target`; what slips is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        tip: Frame,
        mouth: Frame,
        target: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        hover: Metres = 0.1,
        clear: Metres = 0.05,
        speed: Speed = 0.4,
        force: Force = None,
        pull_speed: Speed = 0.15,
        lead: Lead = 0.03,
        above: Annotated[float, Field(gt=0, description="[m] over the place on the way there and back")] = 0.1,
        tolerance: Annotated[float, Field(gt=0, description="[m] horizontally, once it rests")] = 0.03,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
    ) -> None:
        """`clear` [m] is how far the frame `tip` gets beyond `mouth`, whose z points out of the hole."""
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver}
        place = Place(env, **arm, target=target, speed=speed, above=above, retreat=above, tolerance=tolerance)
        pull = PullOut(env, **arm, tip=tip, mouth=mouth, clear=clear, speed=pull_speed, lead=lead)
        pull.foresee(place)
        grasp = Grasp(env, pull, **arm, force=force, offset=offset, hover=hover, lift=0.0, speed=speed)
        members = {"grasp": grasp, "pull out": pull, "place": place}
        slipped = (Outcome.UNSTABLE_GRASP, Outcome.LOST)
        again = {(where, why): "grasp" for where in ("pull out", "place") for why in slipped}
        super().__init__(env, members, back=again, max_attempts=max_attempts)
