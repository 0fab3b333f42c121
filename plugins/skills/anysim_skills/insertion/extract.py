"""Extract: grasp a peg that is in a hole, and pull it out."""

from typing import Annotated

from pydantic import Field

from anysim.skills.base import Outcome
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.insertion.pull_out import Lead, PullOut


class Extract(SkillSequence):
    """Grasp `object` with `robot`, and pull it out of its hole; what the fingers slip off is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        tip: Frame,
        mouth: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        hover: Metres = 0.1,
        clear: Metres = 0.03,
        speed: Speed = 0.4,
        force: Force = None,
        pull_speed: Speed = 0.15,
        lead: Lead = 0.03,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
    ) -> None:
        """`clear` [m] is how far the frame `tip` gets beyond `mouth`, whose z points out of the hole."""
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver}
        pull = PullOut(env, **arm, tip=tip, mouth=mouth, clear=clear, speed=pull_speed, lead=lead)
        grasp = Grasp(env, pull, **arm, force=force, offset=offset, hover=hover, lift=0.0, speed=speed)
        members = {"grasp": grasp, "pull out": pull}
        again = {("pull out", why): "grasp" for why in (Outcome.UNSTABLE_GRASP, Outcome.LOST)}
        super().__init__(env, members, back=again, max_attempts=max_attempts)
