"""Pull: draw an object nearer with a hook that the hand holds."""

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import FIRST_RUNGS, GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.skills.sequence import SkillSequence
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Force, Grasp, Metres, Offset, Speed
from anysim_skills.moving.push import astray, level_way
from anysim_skills.moving.reach import STUCK
from anysim_skills.object_shapes import ObjectShapes
from anysim_skills.recovery.homing import Homing, still_held

AHEAD = 0.03
"""[m] the hook is told to be at most this far ahead of where it touches the object."""

Inner = Annotated[Frame, Field(description="of what is held: the middle of the side that pulls, its x along the pull")]


class Pull(PhasedSkill):
    """Draw `object` to `goal`, horizontally, with the side `inner` of the `hook` that `robot` holds.

    The hook is raised, turned so that its side faces the goal, lowered behind the object and drawn. Behind an object
    that has slipped out of it, it is put again.
    """

    first_rungs: ClassVar[Mapping[Outcome, Rung]] = {
        **{why: rung for why, rung in FIRST_RUNGS.items() if why is not Outcome.UNSTABLE_GRASP},  # to be grasped again
        Outcome.LOST: Rung.REPLAN,
    }

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        hook: ObjectView,
        inner: Inner,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        tolerance: Metres = 0.03,
        clearance: Metres = 0.03,
        rise: Metres = 0.1,
        speed: Speed = 0.3,
        pull_speed: Speed = 0.12,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 400,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._hook, self._inner, self._object, self._goal = hook, inner, object, goal
        self._tolerance, self._clearance, self._rise, self._late = tolerance, clearance, rise, steps
        self._speed, self._pull_speed = speed, pull_speed
        self._shapes = ObjectShapes(env.scene, object)
        n = env.num_envs
        self._line = np.zeros((n, 3))
        """(N, 3) the direction of the pull."""
        self._aloft, self._stuck = np.zeros(n), np.zeros(n, dtype=np.int64)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        return (
            Phase("raise", self._raise, self._raising, self._late),
            Phase("over", self._aim, self._over, self._late),
            Phase("lower", None, self._lower, self._late),
            Phase("pull", None, self._pull, 2 * self._late),
            Phase("leave", None, self._draw_off, self._late),
        )

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, 3, 7) with the hook over and behind the object, and at the end, in grasps (n, g, 7)."""
        way = level_way(self._object, self._goal, at)
        line = way / np.maximum(P.norm(way), 1e-9)[:, None]
        behind = self._behind(ids, at, self._clearance, line)
        over = behind + np.array([0.0, 0.0, self._rise])
        ends = over, behind, self._behind(ids, at, 0.0, line) + way
        return np.stack([_tools_for(self._inner.pose[at], grasps, line, place) for place in ends], axis=2)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False, held=self._hook).phases()

    def recovers(self, env: int, failure: Outcome) -> bool:
        return still_held(self.arm, env, failure)

    def _raise(self, ids: Array, at: Array) -> None:
        self.arm.take(ids, at, self._hook.root)
        up = self._object.root.position[at, 2] + self._rise - self._inner.position[at, 2]
        target = self.arm.command[ids].copy()
        target[:, 2] += np.maximum(up, 0.0)
        self._stuck[ids] = 0
        self.arm.go(ids, target, self._speed)

    def _raising(self, ids: Array, at: Array) -> Array:
        return self._held(ids, at, np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY))

    def _aim(self, ids: Array, at: Array) -> None:
        way = level_way(self._object, self._goal, at)
        self._line[ids] = way / np.maximum(P.norm(way), 1e-9)[:, None]
        self._aloft[ids] = self._inner.position[at, 2]

    def _over(self, ids: Array, at: Array) -> Array:
        place = self._behind(ids, at, self._clearance)
        place[:, 2] = self._aloft[ids]
        self.arm.go(ids, self._tool_for(ids, at, place), self._speed)
        return self._held(ids, at, np.where(self.arm.arrived(ids, at, 0.01, 0.1), GO_ON, STAY))

    def _lower(self, ids: Array, at: Array) -> Array:
        self.arm.go(ids, self._tool_for(ids, at, self._behind(ids, at, self._clearance)), self._speed / 2, 0.03)
        down = self.arm.arrived(ids, at, 0.006, 0.1) | ((self.steps[ids] >= 10) & self.arm.touching(ids, at))
        return self._held(ids, at, np.where(down, GO_ON, STAY))

    def _pull(self, ids: Array, at: Array) -> Array:
        way = level_way(self._object, self._goal, at)
        line, left = self._line[ids], P.norm(way)
        place = self._behind(ids, at, 0.0) + np.clip(P.dot(way, line), 0.0, AHEAD)[:, None] * line
        self.arm.go(ids, self._tool_for(ids, at, place), self._pull_speed)
        said = np.where(astray(way, line, self._tolerance), _LOST, STAY)  # it has slipped out of the hook
        return self._held(ids, at, np.where(left < self._tolerance, GO_ON, said))

    def _draw_off(self, ids: Array, at: Array) -> Array:
        """Off the object, so that it comes to rest."""
        place = self._behind(ids, at, self._clearance)
        self.arm.go(ids, self._tool_for(ids, at, place), self._speed / 2)
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1) | (self.steps[ids] >= 50), GO_ON, STAY)

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del env_ids
        return np.where(P.norm(level_way(self._object, self._goal, at)) < 1.5 * self._tolerance, GO_ON, _LOST)

    # ------------------------------------------------------------------ where

    def _behind(self, ids: Array, at: Array, clearance: float, line: Array | None = None) -> Array:
        """(n, 3) where the inner side is, so far behind the object, for a pull along lines (n, 3)."""
        reach = self._shapes.radius(ids) + clearance
        return self._object.root.position[at] - reach[:, None] * (self._line[ids] if line is None else line)

    def _tool_for(self, ids: Array, at: Array, place: Array) -> Array:
        """Tool poses (n, 7) with the inner side at `place` (n, 3), its x along the pull, as it is held now."""
        return _tools_for(self._inner.pose[at], self.arm.tool.pose[at][:, None], self._line[ids], place)[:, 0]

    def _held(self, ids: Array, at: Array, said: Array) -> Array:
        self._stuck[ids] = (self._stuck[ids] + 1) * self.arm.stuck[ids]
        said = np.where(self._stuck[ids] > STUCK, _NO_IK, said)
        return np.where(self.arm.holds(ids, at, self._hook.root), said, _UNSTABLE)


def _tools_for(inner: Array, tools: Array, line: Array, place: Array) -> Array:
    """Tool poses (n, g, 7) with an inner side (n, 7) at `place` (n, 3), its x along lines (n, 3), as tools hold it."""
    x = P.rotate(inner[:, 3:], np.broadcast_to(np.array([1.0, 0.0, 0.0]), (len(inner), 3)))
    half = 0.5 * np.arctan2(x[:, 0] * line[:, 1] - x[:, 1] * line[:, 0], P.dot(x[:, :2], line[:, :2]))
    turn = np.stack([np.zeros_like(half), np.zeros_like(half), np.sin(half), np.cos(half)], axis=1)
    turns = np.broadcast_to(turn[:, None], (*tools.shape[:2], 4))
    offset = P.rotate(turns, tools[..., :3] - inner[:, None, :3])
    return np.concatenate([place[:, None] + offset, P.multiply(turns, tools[..., 3:])], axis=2)


class PullWithTool(SkillSequence):
    """Grasp `hook` with `robot` and draw `object` to `goal` with its side `inner`; what is lost is grasped again."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        hook: ObjectView,
        inner: Inner,
        object: ObjectView,
        goal: Frame,
        tool: str = "tool",
        solver: str = "numba_ik",
        offset: Offset = (0.0, 0.0, 0.0),
        hover: Metres = 0.1,
        tolerance: Metres = 0.03,
        speed: Speed = 0.3,
        force: Force = None,
        pull_speed: Speed = 0.12,
        max_attempts: Annotated[int, Field(ge=1)] = 3,
    ) -> None:
        arm = {"robot": robot, "tool": tool, "solver": solver, "speed": speed}
        pull = Pull(
            env, **arm, hook=hook, inner=inner, object=object, goal=goal, tolerance=tolerance, pull_speed=pull_speed
        )
        grasp = Grasp(env, pull, **arm, object=hook, force=force, offset=offset, part_only=True, hover=hover, lift=0.05)
        again = {("pull", why): "grasp" for why in (Outcome.UNSTABLE_GRASP,)}
        super().__init__(env, {"grasp": grasp, "pull": pull}, back=again, max_attempts=max_attempts)


_NO_IK, _LOST = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.LOST)
_UNSTABLE = OUTCOMES.index(Outcome.UNSTABLE_GRASP)
