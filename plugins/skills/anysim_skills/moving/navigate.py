"""Navigate: drive a base to a pose on the ground, and stop there."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.arm import Arm
from anysim_skills.grasping.grasp import Metres
from anysim_skills.moving.base import Base, Pace
from anysim_skills.recovery.way_around import WayAround

NEARER = 0.01
"""[m, rad] what counts as nearer."""
STOPPED = 0.02
"""[m/s, rad/s]"""


class DriveTo(PhasedSkill):
    """A skill that drives a base to a pose on the ground, straight or by a `planner`, and stops there.

    A base that is held up fails with `controller`; it backs off once and tries again, and then by a place aside. Arms
    that are told where to go in the world would stay behind: those named in `carried` keep their place on the base.
    """

    first = 1

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        channel: str = "base",
        link: Annotated[str, Field(description="of the robot, that is driven there; its own frame where empty")] = "",
        tolerance: Metres = 0.02,
        angle: Annotated[float, Field(gt=0, description="[rad]")] = 0.035,
        speed: Annotated[float, Field(gt=0, description="[m/s]")] = 0.6,
        rate: Annotated[float, Field(gt=0, description="[rad/s]")] = 1.2,
        back_off: Metres = 0.2,
        carried: Annotated[
            tuple[str, ...], Field(description="tools of arms on the base, which other commands of the episode move")
        ] = (),
        solver: str = "numba_ik",
        planner: Annotated[str, Field(description="of ways around things, as dynamic_window; straight if empty")] = "",
        movers: Annotated[
            tuple[str, ...] | None, Field(description="that it foresees; people and other robots if not given")
        ] = None,
        steps: Annotated[int, Field(ge=1, description="control steps that the way may take")] = 1500,
    ) -> None:
        self.base = Base.of(env, robot, channel=channel, link=link, planner=planner)
        if movers is not None:
            self.base.foresee(movers)
        self._arms = [Arm.of(env, robot, tool=tool, solver=solver) for tool in carried]
        self._tools = np.zeros((env.num_envs, len(carried), 7))
        """(N, T, 7) where their commands stand in the frame of the base."""
        self._way_around = WayAround(env, robot, self.base, channel)
        self._back = back_off
        self._tolerance, self._angle, self._late = tolerance, angle, steps
        self._pace = Pace(speed, rate)
        self._best, self._nearest = np.zeros(env.num_envs), np.zeros(env.num_envs, dtype=np.int64)
        """The least that was left of the way, and the step in which it was."""
        super().__init__(env, [self.base, *self._arms])

    def make_phases(self) -> Sequence[Phase]:
        return (self.stepping_back(), Phase("drive", self._enter, self._drive, self._late))

    def stepping_back(self) -> Phase:
        """Back from what holds the base."""
        return Phase("back off", self._away, self._backing, 150)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Back from what holds the base, once."""
        del env
        return 0 if rung is Rung.BACK_OFF else None

    def make_recovery(self) -> Sequence[Phase]:
        """Back, and to a place aside from which the straight way is free."""
        around = Phase("go around", self._look_aside, self._going_around, self._late + 1)
        return (self.stepping_back(), self.stepping_back(), around)  # twice, for room to turn

    def _look_aside(self, ids: Array, at: Array) -> None:
        aside, found = self._way_around.find(ids, at, self.wanted_stand(ids, at))
        self.base.go(ids, np.where(found[:, None], aside, self.base.pose(at)))
        self._best[ids], self._nearest[ids] = np.inf, 0

    def _going_around(self, ids: Array, at: Array) -> Array:
        distance, turn = self.base.left(ids, at)
        there = (distance < 2 * self._tolerance) & (turn < 2 * self._angle)
        return np.where(there | self._held_up(ids, at) | (self.steps[ids] >= self._late), GO_ON, STAY)

    def _away(self, ids: Array, at: Array) -> None:
        now = self.base.pose(at)
        now[:, :2] -= self._back * (not self.base.planned) * np.stack([np.cos(now[:, 2]), np.sin(now[:, 2])], axis=1)
        self.base.go(ids, now)

    def _backing(self, ids: Array, at: Array) -> Array:
        return np.where((self.base.left(ids, at)[0] < 0.05) | (self.steps[ids] >= 100), GO_ON, STAY)

    def decide(self, ids: Array, at: Array) -> None:
        super().decide(ids, at)
        for number, arm in enumerate(self._arms):  # as the base stands now
            arm.command[ids] = arm.target[ids] = P.compose(self.base.frame.pose[at], self._tools[ids, number])

    def _enter(self, ids: Array, at: Array) -> None:
        for number, arm in enumerate(self._arms):
            self._tools[ids, number] = P.compose(P.inverse(self.base.frame.pose[at]), arm.command[ids])
        self.base.pace, self.base.close = self._pace, 0.5 * self._tolerance
        self.base.go(ids, self.wanted_stand(ids, at))
        self._best[ids], self._nearest[ids] = np.inf, 0

    @abstractmethod
    def wanted_stand(self, ids: Array, at: Array) -> Array:
        """(n, 3) where these envs' bases are to go: x, y [m] and yaw [rad]."""

    def _drive(self, ids: Array, at: Array) -> Array:
        distance, turn = self.base.left(ids, at)
        speed, rate = self.base.speed(at)
        there = (distance < self._tolerance) & (turn < self._angle) & (speed < STOPPED) & (rate < STOPPED)
        said = np.where(self.base.no_way[ids], _NO_PATH, np.where(self._held_up(ids, at), _CONTROLLER, STAY))
        return np.where(there, GO_ON, said)

    def _held_up(self, ids: Array, at: Array) -> Array:
        """(n,) bool: it has not got on for a while; one that turns on the spot is on its way as well."""
        distance, (speed, rate) = self.base.left(ids, at)[0], self.base.speed(at)
        moved = (distance < self._best[ids] - NEARER) | (rate > NEARER * 5) | (speed > NEARER * 5)
        self._best[ids] = np.where(moved, np.minimum(distance, self._best[ids]), self._best[ids])
        self._nearest[ids] = np.where(moved, self.steps[ids], self._nearest[ids])
        return self.steps[ids] - self._nearest[ids] > self.base.held_up


class Navigate(DriveTo):
    """Drive the base of `robot` to x, y and yaw of `goal`, within `tolerance` and `angle`, and stop."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        goal: Frame,
        heading: Annotated[bool, Field(description="whether the yaw of the goal counts")] = True,
        **options: object,
    ) -> None:
        self._goal, self._heading = goal, heading
        super().__init__(env, **options)  # pyright: ignore[reportArgumentType]

    def wanted_stand(self, ids: Array, at: Array) -> Array:
        del ids
        goal = self._goal.pose[at]
        if self._heading:
            yaw = P.yaw(goal[:, 3:])
        else:
            way = goal[:, :2] - self.base.pose(at)[:, :2]
            yaw = np.arctan2(way[:, 1], way[:, 0])
        return np.concatenate([goal[:, :2], yaw[:, None]], axis=1)


_CONTROLLER, _NO_PATH = OUTCOMES.index(Outcome.CONTROLLER), OUTCOMES.index(Outcome.NO_PATH)
