"""Push: move an object across its support with the closed fingers."""

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.moving.push_mpc import StrokePlanner
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.planned_moves import PLANNED_STEPS
from anysim_skills.planning import LATENCY, Latency, PlannerName
from anysim_skills.recovery.homing import Homing

ASTRAY = np.deg2rad(35.0)
"""[rad] an object has left its way when its goal lies further to the side of that than this."""


def level_way(object: ObjectView, goal: Frame, at: Array) -> Array:
    """(n, 3) from an object to its goal, horizontally; `at` are rows of the scene."""
    way = goal.position[at] - object.root.position[at]
    way[:, 2] = 0.0
    return way


def astray(way: Array, line: Array, tolerance: float) -> Array:
    """(n,) bool: what is left of ways (n, 3) is not ahead along lines (n, 3) any more, and not within the tolerance."""
    left = P.norm(way)
    return (left > 2 * tolerance) & (P.dot(way, line) < np.cos(ASTRAY) * left)


class Push(PhasedSkill):
    """Push `object` with `robot` until it lies within `tolerance` of `goal`, horizontally.

    With the backend `planner` a stroke goes straight; with `mpc` the tool's motion in it is found by trying out
    `samples` motions at a time in a batch of the same world on MuJoCo, several times a second.
    """

    first_rungs: ClassVar[Mapping[Outcome, Rung]] = {**FIRST_RUNGS, Outcome.LOST: Rung.REPLAN}

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        tolerance: Metres = 0.02,
        height: Annotated[float, Field(description="[m] of the tool above the object's origin")] = 0.0,
        clearance: Annotated[float, Field(gt=0, description="[m] from the object before the stroke")] = 0.04,
        hover: Metres = 0.12,
        speed: Speed = 0.4,
        stroke_speed: Speed = 0.1,
        backend: Literal["planner", "mpc"] = "planner",
        samples: Annotated[int, Field(ge=4, description="of backend mpc: motions tried out at a time")] = 16,
        planner: PlannerName = "",
        latency: Latency = LATENCY,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver, planner=planner, latency=latency)
        self._plans = bool(planner)
        self._object, self._goal = object, goal
        self._tolerance, self._height, self._clearance, self._hover = tolerance, height, clearance, hover
        self._speed, self._stroke_speed = speed, stroke_speed
        self._shapes = ObjectShapes(env.scene, object)
        self._dt = env.engine.world.physics.control_dt
        n = env.num_envs
        self._way = np.zeros((n, 3))
        """(N, 3) the direction of the stroke."""
        self._turn = np.zeros((n, 4))
        self._blocked = np.zeros(n, dtype=bool)
        self._strokes = (
            StrokePlanner(env, self.arm, "arm", object, goal, stroke_speed, samples) if backend == "mpc" else None
        )
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("rise", self._rise, self._rising, 100),
            *([Phase("plan", self._plan, self._planned, PLANNED_STEPS)] if self._plans else ()),
            Phase("above", None if self._plans else self._aim, self._above, 200),
            Phase("descend", None, self._descend, 150),
            Phase("stroke", self._begin_stroke, self._stroke, 400),
            Phase("retreat", self._rise, self._rising, 100),
        )

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False).phases()

    def retry(self, rung: Rung, env: int) -> int | None:
        """From behind the object again, where it is now."""
        del rung, env
        return 0

    def _rise(self, ids: Array, at: Array) -> None:
        pose = self.arm.tool.pose[at]
        low = self._object.root.position[at, 2] + self._hover
        pose[:, 2] = np.maximum(pose[:, 2], low)
        self.arm.closed[ids] = True
        self.arm.go(ids, pose, self._speed)

    def _rising(self, ids: Array, at: Array) -> Array:
        done = (self._object.root.position[at, 2] + 0.7 * self._hover) < self.arm.tool.position[at, 2]
        return np.where(done, GO_ON, STAY)

    def _aim(self, ids: Array, at: Array) -> None:
        """Stroke towards the goal, the hand's fingers across it: of the two turns the one nearer to the present."""
        way = level_way(self._object, self._goal, at)
        length = P.norm(way)
        self._way[ids] = way / np.maximum(length, 1e-9)[:, None]
        yaw = np.arctan2(way[:, 1], way[:, 0])
        turns = np.stack([_down(yaw), _down(yaw + np.pi)], axis=1)
        behind = self._behind(ids, at)
        targets = np.concatenate([np.repeat(behind[:, None], 2, axis=1), turns], axis=-1)
        goal = targets.copy()
        goal[..., :2] = (self._goal.position[at, :2] - self._shapes.radius(ids)[:, None] * self._way[ids, :2])[:, None]
        effort = self.arm.reach(ids, np.stack([targets, goal], axis=2).reshape(len(ids), 4, 7))[1]
        cost = effort.reshape(len(ids), 2, 2).max(axis=2)
        self._turn[ids] = turns[np.arange(len(ids)), np.argmin(cost, axis=1)]
        self._blocked[ids] = ~np.isfinite(cost.min(axis=1))

    def _behind(self, ids: Array, at: Array) -> Array:
        """(n, 3) behind the object, seen from the goal."""
        place = self._object.root.position[at] - (self._shapes.radius(ids) + self._clearance)[:, None] * self._way[ids]
        place[:, 2] = self._object.root.position[at, 2] + self._height
        return place

    def _plan(self, ids: Array, at: Array) -> None:
        self._aim(ids, at)
        behind = np.concatenate([self._behind(ids, at), self._turn[ids]], axis=1)
        self.arm.plan(ids, self._over(ids, at)[:, None], then=behind)

    def _planned(self, ids: Array, at: Array) -> Array:
        del at
        return np.where(self._blocked[ids], _NO_IK, self.arm.planned(ids))

    def _over(self, ids: Array, at: Array) -> Array:
        """(n, 7) the tool above where the stroke begins."""
        place = self._behind(ids, at)
        place[:, 2] += self._hover
        return np.concatenate([place, self._turn[ids]], axis=1)

    def _above(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._over(ids, at), self._speed)
        return np.where(self._blocked[ids], _NO_IK, np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY))

    def _descend(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, np.concatenate([self._behind(ids, at), self._turn[ids]], axis=1), self._speed / 2)
        return np.where(self.arm.arrived(ids, at, 0.006, 0.1), GO_ON, STAY)

    def _begin_stroke(self, ids: Array, at: Array) -> None:
        del at
        if self._strokes is not None:
            self._strokes.begin(ids, self._way[ids, :2])

    def _stroke(self, ids: Array, at: Array) -> Array:
        """Push on along the line; sideways corrections would drag the object along by friction, the wrong way."""
        thing, way = self._object.root.position[at], level_way(self._object, self._goal, at)
        left = P.norm(way)
        line = self._way[ids]
        ahead = P.dot(way, line)
        reach = np.minimum(np.maximum(ahead, 0.0), 0.03)
        target = thing - self._shapes.radius(ids)[:, None] * line + (reach - 0.002)[:, None] * line
        speed = self._stroke_speed
        if self._strokes is not None:
            self._strokes.step(ids, at, self._turn[ids], self._shapes.radius(ids))
            target[:, :2] = self.arm.command[ids, :2] + self._dt * self._strokes.velocity[ids]
            speed *= 1.5
        target[:, 2] = thing[:, 2] + self._height
        self.arm.go(ids, np.concatenate([target, self._turn[ids]], axis=1), speed)
        there = left < self._tolerance
        lost = astray(way, line, self._tolerance)
        return np.where(there, GO_ON, np.where(lost, _LOST, STAY))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        return np.where(P.norm(level_way(self._object, self._goal, at)) < 1.5 * self._tolerance, GO_ON, _LOST)


def _down(yaw: Array) -> Array:
    """Tool orientations (n, 4) with z down, whose y (across the fingers) is turned by yaw + 90 degrees."""
    half = 0.5 * yaw
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), np.sin(half), zero, zero], axis=1)


_NO_IK, _LOST = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.LOST)
