"""A flying camera as skills fly it: a place and a direction in each env, gone to by velocities of its six joints."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.planning.motion import Budget, PlanRequest, Scenes, Trajectory, motion_planner
from anysim.skills.phases import Mover
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_cameras.easing import brake_speed, shortened
from anysim_cameras.motion import CameraMotion

RESPONSE = 5.0
"""[1/s] of what is left, near the goal."""
BRAKING = 0.6
"""Of the acceleration of its controllers, with which it comes to rest."""
PACE = 0.9
"""Of the speed, on planned ways: the rest is for what the camera lags behind."""
PLANNING = 60.0
"""[s] the net under a planner."""


class Eye(Mover):
    """The place and direction of one flying camera in all envs; what is not told otherwise holds still.

    Attributes:
        place, drift: (N, 3) [m, m/s] where the sliding joints are to be, and how fast that moves.
        angles, swing: (N, 3) [rad, rad/s] the same of yaw, pitch and roll.
        speed: [m/s] at most.
    """

    def __init__(self, env: TaskEnv, robot: RobotView, planner: str = "", clearance: float = 0.0) -> None:
        """`planner` names one that keeps the camera's hull `clearance` [m] from things; without it ways are straight.

        Raises:
            TaskError: the channels `base` and `arm` of the robot do not take velocities by `camera_motion`.
        """
        self.env, self.robot = env, robot
        self._slices = [env.actions.slice_of(robot.name, channel) for channel in ("base", "arm")]
        for one in self._slices:
            if not isinstance(one.controller, CameraMotion) or one.controller.command != "velocity":
                raise TaskError(
                    f"'{robot.name}.{one.channel}' is to be flown by velocities: give it the controller camera_motion"
                )
        world = env.engine.world
        drives = [[world.actuators[a].joint for a in one.controller.channel.actuators] for one in self._slices]
        self._slides, self._turns = np.array(drives[0]), np.array(drives[1])
        moves, turns = (one.controller for one in self._slices)
        assert isinstance(moves, CameraMotion)
        assert isinstance(turns, CameraMotion)
        self.speed = float(moves.high[0])
        self._rate, self._push, self._turn_push = turns.high, BRAKING * moves.push, BRAKING * turns.turn_push
        n = env.num_envs
        self.place, self.drift, self.angles, self.swing = (np.zeros((n, 3)) for _ in range(4))
        self._fresh = np.ones(n, dtype=bool)
        self._planner = motion_planner(world, planner) if planner else None
        self._clearance = clearance
        self._joints = tuple(world.joints[j].name for j in drives[0])

    # ------------------------------------------------------------------ where it is, and where to

    def joints(self, ids: Array) -> tuple[Array, Array]:
        """Its sliding joints (n, 3) [m], and yaw, pitch and roll (n, 3) [rad]."""
        state = self.env.scene.state.joint_pos
        return state[np.ix_(ids, self._slides)], state[np.ix_(ids, self._turns)]

    def local(self, at: Array, points: Array) -> Array:
        """Points (n, 3) in the world as places of the sliding joints."""
        base = self.robot.base.pose[at]
        return P.rotate_inverse(base[:, 3:], points - base[:, :3])

    def towards(self, places: Array, points: Array) -> Array:
        """Yaw, pitch and roll (n, 3) of level views from places of the sliding joints to others."""
        way = points - places
        level = np.hypot(way[:, 0], way[:, 1])
        return np.stack([np.arctan2(way[:, 1], way[:, 0]), np.arctan2(-way[:, 2], level), np.zeros(len(way))], axis=1)

    def hold(self, ids: Array) -> None:
        """Stay where it is."""
        self.place[ids], self.angles[ids] = self.joints(ids)
        self.drift[ids] = self.swing[ids] = 0.0

    def left(self, ids: Array) -> tuple[Array, Array]:
        """(n,) [m] and (n,) [rad] that are left."""
        place, angles = self.joints(ids)
        return P.norm(self.place[ids] - place), np.abs(P.wrapped(self.angles[ids] - angles)).max(axis=1)

    # ------------------------------------------------------------------ ways around things

    def way(self, env: int, place: Array) -> Trajectory | None:
        """A way of the sliding joints from where they are to a place (3,), free of things; None where there is none."""
        start = self.joints(np.array([env]))[0][0]
        if self._planner is None:
            return Trajectory(np.zeros(1), place[None], np.zeros((1, 3)))
        limit = self.env.engine.world.joints[int(self._slides[0])].velocity_limit
        request = PlanRequest(
            self._joints,
            start,
            joint_goal=place,
            padding=self._clearance,
            velocity_scale=min(1.0, self.speed / limit),
            acceleration=self._push,
            seed=int(self.env.streams.episode_seed[env]) % 2**31,
            deadline=PLANNING,
        )
        budget = Budget(PLANNING)
        budget.begin()
        found = self._planner.plan(request, self._scene(env).scene(0), budget).trajectory
        return None if found is None else self._paced(found)

    def _paced(self, way: Trajectory) -> Trajectory:
        """The same way as fast as the limits of the straight line of all three joints allow."""
        if len(way.times) < 2:
            return way
        push = P.norm(np.diff(way.joint_vel, axis=0)) / np.maximum(np.diff(way.times), 1e-9)
        fastest, hardest = P.norm(way.joint_vel).max(), push.max()
        factor = max(fastest / (PACE * self.speed), (hardest / self._push) ** 0.5, 1e-9)
        return Trajectory(way.times * factor, way.joint_pos, way.joint_vel / factor)

    def free(self, env: int, first: Array, last: Array) -> bool:
        """Whether the straight way of the camera between two places (3,) is free; true where nothing plans."""
        if self._planner is None:
            return True
        request = PlanRequest(self._joints, first, joint_goal=last, padding=self._clearance, deadline=PLANNING)
        return self._planner.is_free(request, self._scene(env).scene(0), np.stack([first, last]))

    def _scene(self, env: int) -> Scenes:
        scenes, engine = Scenes(self.env.engine.world, 1), self.env.engine
        scenes.update(engine.get_state().body_pose[env][None], engine.presence[env][None])
        return scenes

    # ------------------------------------------------------------------ moving

    def renew(self, ids: Array) -> None:
        self._fresh[ids] = True

    def prepare(self, ids: Array) -> None:
        fresh = ids[self._fresh[ids]]
        if len(fresh):
            self.hold(fresh)
            self._fresh[fresh] = False

    def act(self, ids: Array, action: Array) -> None:
        place, angles = self.joints(ids)
        way = self.place[ids] - place
        distance = P.norm(way)
        pace = brake_speed(distance, self._push, RESPONSE) / np.maximum(distance, 1e-9)
        moved = shortened(self.drift[ids] + way * pace[:, None], self.speed)
        turn = P.wrapped(self.angles[ids] - angles)
        turned = self.swing[ids] + np.sign(turn) * brake_speed(np.abs(turn), self._turn_push, RESPONSE)
        for one, values in zip(self._slices, (moved, turned), strict=True):
            action[ids, one.start : one.stop] = np.clip(values, one.controller.low, one.controller.high)
