"""Pick: grasp an object from above and bring it to a goal."""

from typing import Annotated

from pydantic import Field

from anysim.skills.base import Outcome
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.grasping.banked import BankFile, CountsFolder, Pinned
from anysim_skills.grasping.bring import Bring
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Speed
from anysim_skills.planning import LATENCY, Latency, PlannerName


class Pick(SkillSequence):
    """Grasp `object` from above with `robot` and bring it to `goal`; what falls is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        descend_speed: Speed = 0.2,
        force: Force = None,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
        phase_steps: Annotated[int, Field(ge=1)] = 150,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
    ) -> None:
        """`hover` [m] is the height of the approach; `phase_steps` bounds each move [control steps]."""
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver, "speed": speed}
        arm |= {"planner": planner, "latency": latency}
        known = {"bank": bank, "living": living, "pinned": pinned}
        pace = {"hover": hover, "descend_speed": descend_speed, "phase_steps": phase_steps}
        bring = Bring(env, **arm, goal=goal)
        grasp = Grasp(env, bring, **arm, **known, **pace, force=force, lift=0.0)
        super().__init__(
            env,
            {"grasp": grasp, "bring": bring},
            back={("bring", Outcome.UNSTABLE_GRASP): "grasp"},
            max_attempts=max_attempts,
        )
        self.grasp = grasp
