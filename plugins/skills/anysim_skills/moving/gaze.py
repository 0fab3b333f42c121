"""A camera on a robot as skills turn it: a point that it is to look at in each env, by the least motion of its joints.

The joints are those of a head, of a pan-tilt unit, or of the arm that carries a camera at its wrist. Each control step
moves them a little along the damped least squares of the angle between the optical axis and the way to the point.
"""

from collections.abc import Sequence
from typing import Self

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.math import pose as P
from anysim.skills.phases import Mover
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_skills.env_lifetime import PerEnv

GAIN = 5.0
"""[1/s] of the angle that is left."""
DAMPING = 0.05
LEAD = 0.3
"""[rad, m] a joint's command runs at most this far ahead of the joint."""
_FORWARD = np.array([0.0, 0.0, 1.0])

_GAZES: PerEnv[tuple[str, str, str, tuple[str, ...]], "Gaze"] = PerEnv()


class Gaze(Mover):
    """The direction of a camera in all envs, by joints of one channel; the channel's others hold where they are.

    Attributes:
        camera: its name in the world.
        point: (N, 3) [m] what it is to look at.
        turning: (N,) bool; the others hold.
        rate: [rad/s, m/s] of the fastest joint.
    """

    def __init__(self, env: TaskEnv, robot: RobotView, camera: str, channel: str, joints: Sequence[str]) -> None:
        self.env, self.camera = env, camera
        self._slice = env.actions.slice_of(robot.name, channel)
        world = env.engine.world
        self._number = env.engine.index.camera(camera)
        self._body = world.cameras[self._number].body
        drives = [world.actuators[a].joint for a in self._slice.controller.channel.actuators]
        self._drives = np.array(drives, dtype=int)
        above, body = set[int](), self._body
        while body >= 0 and (joint := world.body_joint[body]) >= 0:
            above.add(joint)
            body = world.bodies[body].parent
        carrying = {world.joints[j].name.removeprefix(f"{robot.name}."): k for k, j in enumerate(drives) if j in above}
        wrong = [name for name in joints if name not in carrying]
        if wrong or not carrying:
            raise TaskError(
                f"the camera '{camera}' is not carried by {listing(wrong) if wrong else 'any joint'} of "
                f"'{robot.name}.{channel}'; joints of the channel that carry it: {listing(list(carrying))}"
            )
        self._columns = np.array([carrying[name] for name in joints or carrying], dtype=int)
        """(K,) the joints that turn the camera, among the channel's drives."""
        moved = [world.joints[drives[k]] for k in self._columns]
        self._bodies = np.array([joint.body for joint in moved], dtype=int)
        self._axis, self._anchor = (np.array([getattr(j, name) for j in moved]) for name in ("axis", "anchor"))
        self._slides = np.array([str(joint.type) == "prismatic" for joint in moved])
        self._lower, self._upper = (np.array([getattr(j, name) for j in moved]) for name in ("lower", "upper"))
        n = env.num_envs
        self.point, self.turning, self.rate = np.zeros((n, 3)), np.zeros(n, dtype=bool), 1.0
        self._command, self._fresh = np.zeros((n, len(drives))), np.ones(n, dtype=bool)

    @classmethod
    def of(cls, env: TaskEnv, robot: RobotView, camera: str, channel: str, joints: Sequence[str] = ()) -> Self:
        """The gaze of an env, shared by all skills that turn it.

        Raises:
            NameLookupError, TaskError: no such camera or channel, or no such joint carries the camera.
        """
        key = (robot.name, camera, channel, tuple(joints))
        made = _GAZES.of(env, key, lambda: cls(env, robot, camera, channel, joints))
        return made  # pyright: ignore[reportReturnType]

    def renew(self, ids: Array) -> None:
        """These envs have just been reset."""
        self._fresh[ids] = True

    def prepare(self, ids: Array) -> None:
        """Begin from where the joints are, in envs that have been reset."""
        fresh = ids[self._fresh[ids]]
        if len(fresh):
            self._command[fresh] = self.env.scene.state.joint_pos[np.ix_(fresh, self._drives)]
            self.turning[fresh], self._fresh[fresh] = False, False

    def look(self, ids: Array, points: Array) -> None:
        """Turn to points (n, 3) in the world."""
        self.point[ids], self.turning[ids] = points, True

    def stay(self, ids: Array) -> None:
        """Hold still."""
        self.turning[ids] = False

    def rotation(self, ids: Array, points: Array) -> Array:
        """(n, 3) [rad] from the optical axis to points (n, 3), world axes."""
        poses = self.env.engine.camera_poses(self.camera, ids)
        axis = P.rotate(poses[:, 3:], np.broadcast_to(_FORWARD, (len(ids), 3)))
        way = points - poses[:, :3]
        way = way / np.maximum(P.norm(way), 1e-9)[:, None]
        across = P.cross(axis, way)
        size = P.norm(across)
        side = P.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=1)])  # where it lies right behind
        turn = np.where((size < 1e-9)[:, None], side / P.norm(side)[:, None], across / np.maximum(size, 1e-9)[:, None])
        return turn * np.arctan2(size, P.dot(axis, way))[:, None]

    def angle(self, ids: Array, points: Array) -> Array:
        """(n,) [rad] between the optical axis and the way to points (n, 3)."""
        return P.norm(self.rotation(ids, points))

    def act(self, ids: Array, action: Array) -> None:
        """Write the action of these envs: one step of the joints."""
        own = ids[self.turning[ids]]
        if len(own):
            self._step(own)
        targets = self._command[ids]
        action[ids, self._slice.start : self._slice.stop] = self._slice.controller.action_for(targets, ids)

    def _step(self, ids: Array) -> None:
        dt = self.env.engine.world.physics.control_dt
        wanted, ways = self.rotation(ids, self.point[ids]), self._ways(ids)
        square = P.dot(ways[:, :, None], ways[:, None]) + DAMPING**2 * np.eye(3)
        solved = np.linalg.solve(square, wanted[..., None])
        step = GAIN * dt * P.dot(np.swapaxes(ways, 1, 2), np.swapaxes(solved, 1, 2))
        most = np.abs(step).max(axis=1, initial=1e-12)
        step *= np.minimum(1.0, self.rate * dt / most)[:, None]
        now = self.env.scene.state.joint_pos[np.ix_(ids, self._drives[self._columns])]
        rows = np.ix_(ids, self._columns)
        moved = np.minimum(np.maximum(self._command[rows] + step, now - LEAD), now + LEAD)
        self._command[rows] = np.minimum(np.maximum(moved, self._lower), self._upper)

    def _ways(self, ids: Array) -> Array:
        """(n, 3, K) how each joint turns the optical axis relative to the way to the point, without roll about it."""
        eye = self.env.engine.camera_poses(self.camera, ids)
        axis = P.rotate(eye[:, 3:], np.broadcast_to(_FORWARD, (len(ids), 3)))
        body = self.env.scene.state.body_pose[np.ix_(ids, self._bodies)]
        shape = (len(ids), len(self._bodies), 3)
        line = P.rotate(body[..., 3:], np.broadcast_to(self._axis, shape))
        through = body[..., :3] + P.rotate(body[..., 3:], np.broadcast_to(self._anchor, shape))
        speed = np.where(self._slides[:, None], line, P.cross(line, eye[:, None, :3] - through))
        way = self.point[ids] - eye[:, :3]
        far = np.maximum(P.norm(way), 0.05)[:, None]
        turn = (
            np.where(self._slides[:, None], 0.0, line)
            + P.cross(np.broadcast_to((way / far)[:, None], shape), speed) / far[:, None]
        )
        turn -= P.dot(turn, axis[:, None])[..., None] * axis[:, None]
        return np.swapaxes(turn, 1, 2)
