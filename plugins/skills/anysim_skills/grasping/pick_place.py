"""Pick and place: grasp an object and put it down on another."""

from typing import Annotated

from pydantic import Field

from anysim.skills.base import Outcome
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.banked import BankFile, CountsFolder, Pinned
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Speed
from anysim_skills.grasping.place import Place
from anysim_skills.planning import LATENCY, Latency, PlannerName


class PickPlace(SkillSequence):
    """Grasp `object` with `robot` and put it down on `target`; what falls is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        target: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        force: Force = None,
        above: Annotated[float, Field(gt=0, description="[m] over the place on the way there and back")] = 0.06,
        tolerance: Annotated[float, Field(gt=0, description="[m] horizontally, once it rests")] = 0.03,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
    ) -> None:
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver, "speed": speed}
        arm |= {"planner": planner, "latency": latency}
        known = {"bank": bank, "living": living, "pinned": pinned}
        place = Place(env, **arm, target=target, above=above, retreat=max(above, 0.1), tolerance=tolerance)
        members = {"grasp": Grasp(env, place, **arm, **known, force=force, hover=hover, lift=0.0), "place": place}
        again = {("place", why): "grasp" for why in (Outcome.UNSTABLE_GRASP, Outcome.LOST)}
        super().__init__(env, members, back=again, max_attempts=max_attempts)
