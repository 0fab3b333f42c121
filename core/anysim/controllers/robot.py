"""The robot as its controllers know it: the model, its place in the World, and its state now."""

from functools import cached_property

import numpy as np

from anysim.assets.vehicles import PLANAR_JOINTS
from anysim.conventions import Array
from anysim.engine.state import State
from anysim.errors import NameLookupError, TaskError
from anysim.kinematics.pinocchio_model import RobotModel
from anysim.math import pose as P
from anysim.model.frames import find_frame
from anysim.model.index import Index
from anysim.model.world import BodyKind, Robot, World
from anysim.randomization.streams import Streams
from anysim_schemas.robot_model import RobotModelSpec


class ControlledRobot:
    """One robot of every env. Read state inside `apply` and `update` only; rows are those of the env_ids given there.

    Attributes:
        name: its name in the world.
        world: the World it is in.
        joints: (J,) world indices of its joints, depth first.
        drives: (D,) world indices of its actuators.
        drive_columns: (D,) the joint of each drive among the J.
        root: the world index of its base's body.
        floating: whether the base is free.
        dt, control_dt: physics and control time steps [s].
        streams: what a controller draws from, in `reset`; None outside of an env.
    """

    def __init__(self, world: World, name: str, streams: Streams | None = None) -> None:
        index = Index(world)
        entity = index.entity(name)
        self.name, self.world, self.streams = name, world, streams
        self.robot = index.robot(name)
        self.root = _base_of(world, self.robot, entity.root)
        self.floating = world.bodies[self.root].kind is BodyKind.FREE
        self.joints = np.arange(entity.joint_start, entity.joint_stop)
        owned = [i for i, a in enumerate(world.actuators) if entity.joint_start <= a.joint < entity.joint_stop]
        self.drives = np.array(owned, dtype=int)
        self.drive_columns = np.array([world.actuators[i].joint - entity.joint_start for i in owned], dtype=int)
        self.dt, self.control_dt = world.physics.dt, world.physics.control_dt
        self._state: State | None = None
        self._frames: dict[str, tuple[int, P.Offset]] = {}

    @cached_property
    def kinematics(self) -> RobotModel:
        """Its Pinocchio model, made when first asked for; all controllers of the robot share it."""
        return RobotModel(self.world, self.name)

    @property
    def entry(self) -> RobotModelSpec:
        """Its entry in the catalogue.

        Raises:
            TaskError: the World was not made from a catalogue.
        """
        if self.robot.entry is None:
            raise TaskError(f"robot '{self.name}' ({self.robot.model}) is in no catalogue, so it has no controllers")
        return self.robot.entry

    def see(self, state: State) -> None:
        """The state that the properties below read; the manager calls this before each `apply` and `update`."""
        self._state = state

    @property
    def state(self) -> State:
        """The engine's state now."""
        if self._state is None:
            raise NameLookupError(f"robot '{self.name}' has not been shown a state yet; read it in `apply` or `update`")
        return self._state

    def joint_pos(self, env_ids: Array | None) -> Array:
        """(E, J) [rad] or [m]."""
        return self.state.joint_pos[_rows(env_ids)][:, self.joints]

    def joint_vel(self, env_ids: Array | None) -> Array:
        """(E, J) [rad/s] or [m/s]."""
        return self.state.joint_vel[_rows(env_ids)][:, self.joints]

    def base_pose(self, env_ids: Array | None) -> Array:
        """(E, 7) of the base's frame in the world [m, xyzw]."""
        return self.state.body_pose[_rows(env_ids), self.root]

    def base_twist(self, env_ids: Array | None) -> Array:
        """(E, 6) of the base's frame, world axes [m/s, rad/s]."""
        return self.state.body_twist[_rows(env_ids), self.root]

    def frame_pose(self, env_ids: Array | None, name: str) -> Array:
        """(E, 7) of a tool, sensor or link in the world, as measured [m, xyzw].

        Raises:
            NameLookupError: lists the frames that exist.
        """
        if name not in self._frames:
            frame = find_frame(self.world, f"{self.name}.{name}")
            self._frames[name] = (frame.body, P.Offset(P.pose(frame.position, frame.quaternion)))
        body, local = self._frames[name]
        return local.seen_from(self.state.body_pose[_rows(env_ids), body])


def _base_of(world: World, robot: Robot, root: int) -> int:
    """The body that the robot stands on: of a `planar` base what the last of its joints moves, not the rail."""
    if robot.entry is None or robot.entry.base != "planar":
        return root
    return next(joint.body for joint in world.joints if joint.name == f"{robot.name}.{PLANAR_JOINTS[-1]}")


def _rows(env_ids: Array | None) -> slice | Array:
    return slice(None) if env_ids is None else env_ids
