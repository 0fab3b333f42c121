"""What terms see: handles that read the engine's state for the rows at hand.

A term declares what it refers to by annotation (`a: Frame`, `robot: RobotView`); names become handles once, when the
env is built. A handle returns arrays for `scene.rows` only: all envs in a step, the reset ones in a reset.
"""

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.index import FrameIndex
from anysim.engine.state import State
from anysim.errors import NameLookupError, listing, suggest
from anysim.managers.terrain import TerrainManager
from anysim.math import pose as P
from anysim.world.model import BodyKind


class SceneView:
    """The scene of all envs, restricted to `rows`. Values are computed once per moment however many terms ask."""

    def __init__(self, engine: SimEngine) -> None:
        self.engine = engine
        self.index = engine.index
        self.goals: dict[str, Array] = {}
        """Goal poses (N, 7) by command name."""
        self.last_action = np.zeros((engine.num_envs, 0))
        """The last action (N, A), clipped."""
        self.origin = np.zeros((engine.num_envs, 3))
        """Where each env's scene stands on the ground (N, 3) [m]."""
        self.terrain: TerrainManager | None = None
        """Who stands on which tile, and at which level; None in an env without managers."""
        self.elapsed = np.zeros(engine.num_envs, dtype=np.int64)
        """Control steps since each env's reset (N,)."""
        self._rows: Array | slice = slice(None)
        self._frames: dict[str, Frame] = {}
        self._robots: dict[str, RobotView] = {}
        self.moment = 0

    def look(self, rows: Array | None) -> None:
        """Start a new moment: all envs (None), or these."""
        self._rows = slice(None) if rows is None else rows
        self.moment += 1

    @property
    def rows(self) -> Array | slice:
        """What indexes an (N, ...) array down to the rows at hand."""
        return self._rows

    @property
    def env_ids(self) -> Array:
        """The envs at hand (n,)."""
        return np.arange(self.engine.num_envs)[self._rows]

    @property
    def state(self) -> State:
        """The engine's state, of all envs: index it with `rows`."""
        return self.engine.get_state()

    def frame(self, name: str) -> "Frame":
        """The handle of a frame or goal."""
        handle = self._frames.get(name)
        if handle is None:
            handle = GoalFrame(self, name) if name in self.goals else self._world_frame(name)
            self._frames[name] = handle
        return handle

    def _world_frame(self, name: str) -> "Frame":
        try:
            return BodyFrame(self, self.index.frame(name))
        except NameLookupError as error:
            goals = f" Goals: {listing(self.goals)}{suggest(name, list(self.goals))}." if self.goals else ""
            raise NameLookupError(f"{error}.{goals}") from None

    def robot(self, name: str) -> "RobotView":
        """The handle of a robot."""
        handle = self._robots.get(name)
        if handle is None:
            handle = self._robots[name] = RobotView(self, name)
        return handle


class Frame(ABC):
    """A frame in the world: an entity, a link, a tool or a goal. In YAML: its name."""

    reference_kind: ClassVar[str] = "frame"

    def __init__(self, scene: SceneView, name: str) -> None:
        self.scene, self.name = scene, name
        self._moment, self._pose = -1, np.zeros((0, 7))

    @property
    def pose(self) -> Array:
        """(n, 7) in the world frame."""
        if self._moment != self.scene.moment:
            self._pose, self._moment = self._compute(), self.scene.moment
        return self._pose

    @property
    def position(self) -> Array:
        """(n, 3) [m]."""
        return self.pose[:, :3]

    @property
    def quaternion(self) -> Array:
        """(n, 4) xyzw."""
        return self.pose[:, 3:]

    @property
    def twist(self) -> Array:
        """(n, 6): velocity of the frame's origin [m/s] and rate [rad/s], world axes."""
        return np.zeros((len(self.pose), 6))

    @abstractmethod
    def _compute(self) -> Array:
        """The pose (n, 7) now."""


class GoalFrame(Frame):
    """Where a command wants something to be."""

    def _compute(self) -> Array:
        return self.scene.goals[self.name][self.scene.rows]


class BodyFrame(Frame):
    """A frame fixed to a body."""

    def __init__(self, scene: SceneView, frame: FrameIndex) -> None:
        super().__init__(scene, frame.name)
        self.index = frame
        local = np.array([*frame.position, *frame.quaternion])
        self._local = None if (local == [0, 0, 0, 0, 0, 0, 1]).all() else local[None]

    def _compute(self) -> Array:
        if self.index.body < 0:
            fixed = np.array([[0, 0, 0, 0, 0, 0, 1.0]]) if self._local is None else self._local
            return np.repeat(fixed, len(self.scene.env_ids), axis=0)
        body = self.scene.state.body_pose[self.scene.rows, self.index.body]
        return body if self._local is None else P.compose(body, np.broadcast_to(self._local, body.shape))

    @property
    def twist(self) -> Array:
        if self.index.body < 0:
            return np.zeros((len(self.scene.env_ids), 6))
        body = self.scene.state.body_twist[self.scene.rows, self.index.body]
        if self._local is None:
            return body
        pose = self.scene.state.body_pose[self.scene.rows, self.index.body]
        arm = self.position - pose[:, :3]
        return np.concatenate([body[:, :3] + P.cross(body[:, 3:], arm), body[:, 3:]], axis=-1)


class ObjectView:
    """An object of the world. In YAML: its name."""

    reference_kind: ClassVar[str] = "object"

    def __init__(self, scene: SceneView, name: str) -> None:
        entity = scene.index.entity(name)
        self.name, self.entity = name, entity
        self.root = scene.frame(name)
        self.movable = scene.engine.world.bodies[entity.root].kind is BodyKind.FREE


class RobotView:
    """A robot of the world. In YAML: its name."""

    reference_kind: ClassVar[str] = "robot"

    def __init__(self, scene: SceneView, name: str) -> None:
        self.scene, self.name = scene, name
        self.model = scene.index.robot(name)
        entity = scene.index.entity(name)
        self._joints = slice(entity.joint_start, entity.joint_stop)
        world = scene.engine.world
        arm = [j for c in self.model.channels.values() if c.opened is None for j in c.joints]
        self.arm_joints = np.array(sorted(arm), dtype=int)
        """World indices of the joints of all channels that are no grippers."""
        self.lower = np.array([j.lower for j in world.joints[self._joints]])
        self.upper = np.array([j.upper for j in world.joints[self._joints]])

    @property
    def joint_pos(self) -> Array:
        """(n, J) [rad, m] of the robot's joints."""
        return self.scene.state.joint_pos[self.scene.rows, self._joints]

    @property
    def joint_vel(self) -> Array:
        """(n, J) [rad/s, m/s] of the robot's joints."""
        return self.scene.state.joint_vel[self.scene.rows, self._joints]

    @property
    def arm_speed(self) -> Array:
        """(n,) the largest absolute joint velocity outside the grippers."""
        velocity = self.scene.state.joint_vel[self.scene.rows]
        return np.abs(velocity[:, self.arm_joints]).max(axis=1)

    def tool(self, name: str = "tool") -> Frame:
        """The frame of one of its tools."""
        return self.scene.frame(f"{self.name}.{name}")
