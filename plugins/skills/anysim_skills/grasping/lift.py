"""Lift: grasp an object and hold it above where it lay."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView, RobotView
from anysim_skills.grasping.banked import BankFile, CountsFolder, Pinned
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.planning import LATENCY, Latency, PlannerName


class Lift(Grasp):
    """Grasp `object` with `robot`, lift it by `height` and hold it there; what slips is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        height: Metres = 0.2,
        hold: Annotated[int, Field(ge=1, description="control steps")] = 10,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        hover: Metres = 0.1,
        speed: Speed = 0.4,
        force: Force = None,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
        bank: BankFile = None,
        living: CountsFolder = None,
        pinned: Pinned = "",
    ) -> None:
        self._hold = hold
        arm = {"robot": robot, "object": object, "tool": tool, "solver": solver, "speed": speed}
        arm |= {"planner": planner, "latency": latency}
        known = {"bank": bank, "living": living, "pinned": pinned}
        super().__init__(env, **arm, **known, force=force, offset=offset, hover=hover, lift=height)

    def make_phases(self) -> Sequence[Phase]:
        return (*super().make_phases(), Phase("hold", None, self._holding, self._hold + 1))

    def _holding(self, ids: Array, at: Array) -> Array:
        held = self.arm.holds(ids, at, self._object.root)
        return self._fingers.kept(ids, held, np.where(self.steps[ids] >= self._hold, GO_ON, STAY))


_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
