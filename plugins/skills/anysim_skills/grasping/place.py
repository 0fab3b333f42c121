"""Place: put a held object down on something, let go of it, and see that it rests there."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.grasping.held import RAISED, RESTING, Moves, PutsDown, turned_about
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.planned_moves import PLANNED_STEPS
from anysim_skills.planning import LATENCY, Latency, PlannerName

GENTLE = 0.015
"""[m] lead of the command while the object is put down: it bounds the force on what is below."""
SETTLING_STEPS = 15


class Place(PutsDown):
    """Put the held `object` down on `target`, whose frame its origin ends up over."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        target: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        above: Annotated[float, Field(gt=0, description="[m] clearance before it is lowered")] = 0.06,
        speed: Speed = 0.4,
        lower_speed: Speed = 0.06,
        align: Metres = 0.003,
        tolerance: Annotated[float, Field(gt=0, description="[m] horizontally, once it rests")] = 0.03,
        retreat: Metres = 0.1,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        self._target, self._above, self._align, self._tolerance = target, above, align, tolerance
        self._height, self.deep = np.zeros((2, env.num_envs))
        """(N,) [m] of the object's origin above the target's when it rests there; how far below that it may come."""
        self._shapes = ObjectShapes(env.scene, object)
        self._support = env.scene.entity_shape(target.name.partition(".")[0]) if _is_entity(env, target) else None
        self._plans = bool(planner)
        arm = Arm.of(env, robot, tool=tool, solver=solver, planner=planner, latency=latency)
        super().__init__(env, arm, object, Moves(speed, lower_speed, retreat, steps))

    def make_phases(self) -> Sequence[Phase]:
        planned = (
            Phase("raise", self._raise, self._raising, self.moves.steps),
            Phase("plan", self._plan, self._planned, PLANNED_STEPS),
        )
        return (
            *(planned if self._plans else ()),
            Phase("transport", self.measure, self._transport, self.moves.steps),
            Phase("align", None, self._aligning, 60),
            Phase("lower", None, self._lowering, self.moves.steps),
            *self.let_go(),
            Phase("settle", None, self._settling, SETTLING_STEPS + 1),
        )

    def retry(self, rung: Rung, env: int) -> int | None:
        """Another plan; None: what is not held any more has to be grasped again."""
        return 1 if rung is Rung.REPLAN and self._plans and self.phase[env] == 1 else None

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, 1, 7) over the target in grasps (n, g, 7), no higher than these."""
        del ids
        poses = grasps[:, :, None].copy()
        held = poses[..., :2] - self.object.root.position[at, :2][:, None, None]
        poses[..., :2] = self._target.position[at, :2][:, None, None] + held
        return poses

    # ------------------------------------------------------------------ phases

    def _raise(self, ids: Array, at: Array) -> None:
        """Off what it stands on, so that nothing is touched where the plan begins."""
        self.measure(ids, at)
        self.arm.go(ids, self.arm.command[ids] + RAISED, self.moves.speed / 2)

    def _raising(self, ids: Array, at: Array) -> Array:
        return self.held(ids, at, np.where(self.arm.arrived(ids, at), GO_ON, STAY))

    def _plan(self, ids: Array, at: Array) -> None:
        place = self._target.position[at].copy()
        place[:, 2] += self._height[ids] + self._above
        goals = turned_about(self.arm.tool.pose[at], self.object.root.position[at], place)
        self.arm.plan(ids, goals, held=self.object)

    def _planned(self, ids: Array, at: Array) -> Array:
        return self.held(ids, at, self.arm.planned(ids))

    def measure(self, ids: Array, at: Array) -> None:
        """How high the object's origin is to be above the target's when it rests there."""
        self.take(ids, at)
        pose = self.object.root.pose[at]
        below = self._shapes.below(ids, pose)
        on = 0.0
        if self._support is not None:
            target = self._target.pose[at]
            on = self._support.bounds(target)[1][..., 2] - target[:, 2]
        self._height[ids] = below + on

    def _goal(self, ids: Array, at: Array, above: float | Array) -> Array:
        """Tool poses (n, 7) at which the object is over the target, with the loop closed on where it is."""
        thing, target = self.object.root.position[at], self._target.position[at]
        place = target + (self.arm.tool.position[at] - thing)
        place[:, 2] += self._height[ids] + above
        return np.concatenate([place, self.arm.target[ids, 3:]], axis=1)

    def _off(self, at: Array) -> Array:
        """(n,) [m] how far the object is from over the target, horizontally."""
        return P.norm((self.object.root.position[at] - self._target.position[at])[:, :2])

    def _transport(self, ids: Array, at: Array) -> Array:
        """Up first where the object is lower than it is to pass, then across."""
        goal = self._goal(ids, at, self._above)
        low = self.arm.tool.position[at, 2] < goal[:, 2] - 0.02
        far = self._off(at) > self._tolerance
        straight_up = low & far
        goal[straight_up, :2] = self.arm.command[ids[straight_up], :2]
        self.arm.go(ids, goal, self.moves.speed)
        near = ~far & (np.abs(self.arm.tool.position[at, 2] - goal[:, 2]) < 0.02)
        return self.held(ids, at, np.where(near, GO_ON, STAY))

    def _aligning(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._goal(ids, at, self._above), self.moves.speed / 4)
        ready = (self._off(at) < self._align) & self.slow(at, RESTING)
        return self.held(ids, at, np.where(ready | (self.steps[ids] >= 50), GO_ON, STAY))

    def _lowering(self, ids: Array, at: Array) -> Array:
        goal = self._goal(ids, at, -2 * GENTLE - self.deep[ids])  # beyond contact, which is what ends it
        self.arm.go(ids, goal, self.moves.lower_speed, GENTLE)
        low = (
            self.object.root.position[at, 2] - self._target.position[at, 2] - self._height[ids] + self.deep[ids] < 0.001
        )
        down = (self.steps[ids] >= 5) & (self.arm.touching(ids, at) | low)
        return self.held(ids, at, np.where(down, GO_ON, STAY))

    def _settling(self, ids: Array, at: Array) -> Array:
        return np.where(self.slow(at, RESTING) | (self.steps[ids] >= SETTLING_STEPS), GO_ON, STAY)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        thing, target = self.object.root.position[at], self._target.position[at]
        high = np.abs(thing[:, 2] - target[:, 2] - self._height[env_ids]) < self._tolerance
        return np.where(high & (self._off(at) < self._tolerance), GO_ON, _LOST)


def _is_entity(env: TaskEnv, frame: Frame) -> bool:
    return frame.name.partition(".")[0] in env.engine.world.entity_numbers and "." not in frame.name


_LOST = OUTCOMES.index(Outcome.LOST)
