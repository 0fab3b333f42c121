"""FlyTo: carry a flying camera to a pose, around things if a planner is named."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.planning.motion import Trajectory
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_cameras.eye import Eye

Clearance = Annotated[float, Field(ge=0, description="[m] from the camera's hull to things")]
Planner = Annotated[str, Field(description="of ways around things, such as rrt; empty: straight lines")]
Steps = Annotated[int, Field(ge=1, description="control steps that a way may take")]


class Flight(PhasedSkill):
    """What skills of flying cameras share: ways that are planned once, and followed with their velocity."""

    def __init__(self, env: TaskEnv, robot: RobotView, planner: str, clearance: float, steps: int) -> None:
        self.eye = Eye(env, robot, planner, clearance)
        self._dt, self._late = env.engine.world.physics.control_dt, steps
        self._ways: list[Trajectory | None] = [None] * env.num_envs
        self._begun = np.zeros(env.num_envs, dtype=np.int64)
        super().__init__(env, [self.eye])

    def retry(self, rung: Rung, env: int) -> int | None:
        """The same question has the same answer."""
        del rung, env
        return None

    def set_out(self, env: int, place: Array, angles: Array) -> bool:
        """Begin a way to a place (3,) and angles (3,) of the joints; false where there is none."""
        self._ways[env] = found = self.eye.way(env, place)
        self._begun[env] = self.steps[env]
        if found is not None:
            self.eye.angles[env], self.eye.swing[env] = angles, 0.0
        return found is not None

    def go_on(self, ids: Array) -> None:
        """Follow the ways of these envs."""
        for env in ids.tolist():
            way = self._ways[env]
            if way is None:
                continue
            now = (self.steps[env] - self._begun[env] + 1) * self._dt
            self.eye.place[env] = [np.interp(now, way.times, way.joint_pos[:, k]) for k in range(3)]
            under_way = now < way.times[-1]
            self.eye.drift[env] = [
                np.interp(now, way.times, way.joint_vel[:, k]) if under_way else 0.0 for k in range(3)
            ]

    def there(self, ids: Array, place: float, angle: float) -> Array:
        """(n,) whether these envs are within [m] and [rad] of the ends of their ways."""
        ways = [self._ways[env] for env in ids.tolist()]
        left, turn = self.eye.left(ids)
        ended = [
            way is not None and (self.steps[env] - self._begun[env]) * self._dt >= way.times[-1]
            for env, way in zip(ids.tolist(), ways, strict=True)
        ]
        return np.array(ended) & (left < place) & (turn < angle)


class FlyTo(Flight):
    """Carry a flying camera to the pose of `goal`, whose x axis is where it looks."""

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        goal: Frame,
        planner: Planner = "",
        clearance: Clearance = 0.05,
        tolerance: Annotated[float, Field(gt=0, description="[m]")] = 0.01,
        angle: Annotated[float, Field(gt=0, description="[rad]")] = 0.02,
        steps: Steps = 900,
    ) -> None:
        self._goal, self._tolerance, self._angle = goal, tolerance, angle
        super().__init__(env, robot, planner, clearance, steps)
        self._none = np.zeros(env.num_envs, dtype=bool)

    def make_phases(self) -> Sequence[Phase]:
        return (Phase("fly", self._plan, self._fly, self._late),)

    def _plan(self, ids: Array, at: Array) -> None:
        base, goal = self.eye.robot.base.pose[at], self._goal.pose[at]
        angles = P.to_roll_pitch_yaw(P.multiply(P.conjugate(base[:, 3:]), goal[:, 3:]))[:, ::-1]
        for env, place, turn in zip(ids.tolist(), self.eye.local(at, goal[:, :3]), angles, strict=True):
            self._none[env] = not self.set_out(env, place, turn)

    def _fly(self, ids: Array, at: Array) -> Array:
        del at
        self.go_on(ids)
        said = np.where(self.there(ids, self._tolerance, self._angle), GO_ON, STAY)
        return np.where(self._none[ids], NO_PATH, said)


NO_PATH = OUTCOMES.index(Outcome.NO_PATH)
