"""Bring: move a held object through the air to a goal, with the loop closed on where the object is."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, MovingSkill, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.grasping.held import RAISED, turned_about
from anysim_skills.look_ahead import LookAhead
from anysim_skills.planned_moves import PLANNED_STEPS
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.recovery.homing import Homing, still_held

STILL = 0.05
"""[m/s] an object that moves slower has come to rest in the air."""


class Bring(PhasedSkill):
    """Bring the held `object` to `goal` and hold it there."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        speed: Speed = 0.4,
        tolerance: Metres = 0.01,
        hold: Annotated[int, Field(ge=1, description="control steps")] = 10,
        steps: Annotated[int, Field(ge=1, description="control steps that the way may take")] = 400,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver, planner=planner, latency=latency)
        self._plans = bool(planner)
        self._object, self._goal, self._speed, self._tolerance = object, goal, speed, tolerance
        self._hold, self._late = hold, steps
        self._held = np.zeros(env.num_envs, dtype=np.int64)
        self._ahead = LookAhead(self.arm)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        carry = Phase("carry", self._enter, self._carry, self._late)
        if not self._plans:
            return (carry,)
        return (
            Phase("raise", self._raise, self._raising, self._late),
            Phase("plan", self._plan, self._planned, PLANNED_STEPS),
            carry,
        )

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False, held=self._object).phases()

    def recovers(self, env: int, failure: Outcome) -> bool:
        return still_held(self.arm, env, failure)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Another plan; None: what is not held any more has to be grasped again."""
        return 1 if rung is Rung.REPLAN and self._plans and self.phase[env] == 1 else None

    def foresee(self, following: MovingSkill) -> None:
        self._ahead.foresee(following)

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, c, m, 7) that bring the object to the goal in grasps (n, g, 7), and on from there."""
        poses = grasps[:, :, None].copy()
        held = poses[..., :3] - self._object.root.position[at][:, None, None]
        poses[..., :3] = self._goal.position[at][:, None, None] + held
        return self._ahead.ways(ids, at, grasps, poses)

    def _raise(self, ids: Array, at: Array) -> None:
        """Off what it stands on, so that nothing is touched where the plan begins."""
        self.arm.take(ids, at, self._object.root)
        self.arm.go(ids, self.arm.command[ids] + RAISED, self._speed / 2)

    def _raising(self, ids: Array, at: Array) -> Array:
        held = self.arm.holds(ids, at, self._object.root)
        return np.where(~held, _UNSTABLE, np.where(self.arm.arrived(ids, at), GO_ON, STAY))

    def _plan(self, ids: Array, at: Array) -> None:
        goals = turned_about(self.arm.tool.pose[at], self._object.root.position[at], self._goal.position[at])
        self.arm.plan(ids, goals, held=self._object)

    def _planned(self, ids: Array, at: Array) -> Array:
        held = self.arm.holds(ids, at, self._object.root)
        return np.where(held, self.planned(ids), _UNSTABLE)

    def planned(self, ids: Array) -> Array:
        """(n,) how the planned move stands, as `Arm.planned` says."""
        return self.arm.planned(ids)

    def _enter(self, ids: Array, at: Array) -> None:
        self.arm.take(ids, at, self._object.root)
        self._held[ids] = 0

    def _carry(self, ids: Array, at: Array) -> Array:
        thing, goal = self._object.root.position[at], self._goal.position[at]
        target = np.concatenate([goal + (self.arm.tool.position[at] - thing), self.arm.target[ids, 3:]], axis=1)
        self.arm.go(ids, target, self._speed)
        there = (P.norm(goal - thing) < self._tolerance) & (P.norm(self._object.root.twist[at, :3]) < STILL)
        self._held[ids] = (self._held[ids] + 1) * there
        lost = ~self.arm.holds(ids, at, self._object.root)
        return np.where(lost, _UNSTABLE, np.where(self._held[ids] >= self._hold, GO_ON, STAY))


_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
