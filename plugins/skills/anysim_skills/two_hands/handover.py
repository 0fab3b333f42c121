"""Handover: one arm grasps an object and holds it out, the other takes it, and the first lets go."""

from typing import Annotated

from pydantic import Field

from anysim.skills.base import Outcome
from anysim.skills.phases import MovingSkill
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.bring import Bring
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.grasping.release import Release
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.two_hands.hold_out import HoldOut


class Handover(SkillSequence):
    """Pass `object` from `robot` to `receiver` at `meeting`; each grasps it at an offset of its own."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        receiver: RobotView,
        object: ObjectView,
        meeting: Frame,
        give: Offset = (0.0, 0.0, 0.0),
        take: Offset = (0.0, 0.0, 0.0),
        tool: str = "tool",
        solver: str = "numba_ik",
        hover: Metres = 0.12,
        retreat: Metres = 0.15,
        speed: Speed = 0.3,
        force: Force = None,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        """With a `planner` both arms go to the meeting at once, in one plan."""
        both = {"object": object, "tool": tool, "solver": solver}
        close = {"force": force, "hover": hover, "speed": speed}
        plans = {"planner": planner, "latency": latency}
        if planner:
            taker = Arm.of(env, receiver, tool=tool, solver=solver)
            hold_out = HoldOut(env, taker, take, hover, **both, **plans, robot=robot, goal=meeting, speed=speed)
        else:
            hold_out = Bring(env, **both, robot=robot, goal=meeting, speed=speed)
        self._take = Grasp(env, **both, **close, robot=receiver, offset=take, lift=0.0)
        members = {
            "grasp": Grasp(env, hold_out, **both, **close, **plans, robot=robot, offset=give, lift=0.05),
            "hold out": hold_out,
            "take": self._take,
            "let go": Release(env, robot=robot, tool=tool, solver=solver, retreat=retreat),
        }
        again = {("hold out", Outcome.UNSTABLE_GRASP): "grasp"}
        super().__init__(env, members, back=again, max_attempts=max_attempts)

    def foresee(self, following: MovingSkill) -> None:
        """It is the receiver that goes on with the object."""
        self._take.foresee(following)
