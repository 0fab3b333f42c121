"""Arms as a device drives them: twists of a tool become actions of its channels, in one env."""

from collections.abc import Sequence

import numpy as np

from anysim.controllers.base import Controller
from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.errors import AnysimError, TaskError, listing, suggest
from anysim.kinematics.chain import Chain
from anysim.managers.action import ActionSlice
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.api import inverse_kinematics
from anysim.task.env import TaskEnv
from anysim_teleop.device import DeviceInput

LEAD = 0.05
"""[m] the commanded tool runs at most this far ahead of the real one, which bounds what it presses with."""
LEAD_ANGLE = 0.4
"""[rad] the same for its rotation."""
POSTURE_GAIN = 0.02
"""The part of the way back to the posture of the reset that the freedom left by the tool takes in a control step."""
_FASTEST = 10.0
"""[rad/s, m/s] of joints without a velocity limit."""
_ENV = np.zeros(1, dtype=int)


class DrivenChannel:
    """A channel with what its drives (K,) are told: held as the reset left them, unless an arm moves some of them."""

    def __init__(self, env: TaskEnv, part: ActionSlice) -> None:
        world = env.engine.world
        self._env, self._part = env, part
        self.channel = part.controller.channel
        self.takes_joints = type(part.controller).action_for is not Controller.action_for
        """Whether its controller can be asked for joint positions."""
        self.apart = part.controller.dim == len(self.channel)
        """Whether each drive has a component of the action of its own."""
        self.joints = np.array([world.actuators[a].joint for a in self.channel.actuators], dtype=int)
        self.targets = np.zeros(len(self.joints))

    def begin(self) -> None:
        """Hold what is measured."""
        self.targets[:] = self._env.scene.state.joint_pos[0, self.joints]

    def write(self, action: Array) -> None:
        """Write the columns of the action (A,); a controller that takes no joint positions is asked for nothing."""
        part = self._part
        if self.takes_joints:
            action[part.start : part.stop] = part.controller.action_for(self.targets[None], _ENV)[0]
        else:
            action[part.start : part.stop] = np.clip(0.0, part.controller.low, part.controller.high)


class DrivenArm:
    """One tool, the joints that move it, and its gripper if it has one.

    Attributes:
        name: `robot.tool`.
        command: (7,) where the tool is told to be now, world frame.
    """

    def __init__(
        self, env: TaskEnv, name: str, chain: Chain, channel: DrivenChannel, gripper: DrivenChannel | None, solver: str
    ) -> None:
        self.name, self.chain = name, chain
        self._env, self._channel, self._gripper = env, channel, gripper
        self._tool = env.scene.frame(name)
        self._solver = inverse_kinematics(chain, solver)
        self._columns = np.array([int(np.flatnonzero(channel.joints == j)[0]) for j in chain.joints])
        self._dt = env.engine.world.physics.control_dt
        limit = np.where(chain.velocity_limit > 0, np.minimum(chain.velocity_limit, _FASTEST), _FASTEST)
        self._most = limit * self._dt
        self._fingers = np.zeros(0, dtype=int) if gripper is None else _below(env.engine.world, gripper, chain)
        self.command = P.pose(np.zeros(3), IDENTITY_QUATERNION)
        self._posture = chain.initial
        self._follow(self.command, chain.initial)  # so that what is compiled is there before the first key

    def begin(self) -> None:
        """Begin where the tool is, with an open gripper."""
        self.command = self._tool.pose[0].copy()
        self._posture = self._channel.targets[self._columns].copy()
        self.grip(False)

    @property
    def closed(self) -> bool:
        """Whether the gripper is told to close."""
        if self._gripper is None or self._gripper.channel.closed is None:
            return False
        return bool((self._gripper.targets == self._gripper.channel.closed)[self._fingers].all())

    def grip(self, closed: bool) -> None:
        """Tell the gripper to close, or to open; grippers that only open and close together do."""
        if self._gripper is None:
            return
        view = self._gripper.channel
        ends = view.closed if closed else view.opened
        assert ends is not None
        own = self._fingers if self._gripper.apart else slice(None)
        self._gripper.targets[own] = ends[own]

    def move(self, wanted: DeviceInput, speed: float, turn: float) -> None:
        """Move the command by one control step, and the joints after it.

        Args:
            wanted: the twist; longer than `speed` [m/s] or `turn` [rad/s] it is shortened.
            speed: bound of its linear part.
            turn: bound of its angular part.
        """
        base = self._env.scene.state.body_pose[0, self.chain.root]
        axes = base[3:] if wanted.frame == "base" else self.command[3:]
        linear = P.rotate(axes[None], _shortened(wanted.twist[:3], speed)[None])[0] * self._dt
        angular = P.rotate(axes[None], _shortened(wanted.twist[3:], turn)[None])[0] * self._dt
        angle = float(np.linalg.norm(angular))
        rotation = self.command[3:]
        if angle > 0:
            rotation = P.normalize(P.multiply(P.from_axis_angle(angular / angle, np.array(angle)), rotation))
        real = self._tool.pose
        command = np.concatenate([self.command[:3] + linear, rotation])[None]
        place = P.step_toward(real, command, LEAD, np.inf)[0, :3]  # apart: a tool that turns late is not held back
        self.command = np.append(place, P.step_toward(real, command, np.inf, LEAD_ANGLE)[0, 3:])
        self._channel.targets[self._columns] = self._follow(base, self._channel.targets[self._columns])

    def _follow(self, base: Array, joints: Array) -> Array:
        """Joint positions (K,) one step nearer to the command."""
        step = self._solver.step(
            self.command[None],
            base[None],
            joints[None],
            max_step=self._most,
            posture=self._posture,
            posture_gain=POSTURE_GAIN,
        )
        return step.joint_pos[0]


class Drives:
    """All channels of an env with one env: the arms that can be driven, one of them active, the others held.

    Attributes:
        arms: in the order in which `switch` goes through them.
        active: the one that is driven.
    """

    def __init__(self, env: TaskEnv, robot: str | None = None, solver: str = "numba_ik") -> None:
        """Arms of one robot, or of all.

        Raises:
            TaskError: there is no such robot, or none with a tool that an arm moves.
        """
        self._env = env
        world = env.engine.world
        names = [r.name for r in world.robots]
        if robot is not None and robot not in names:
            raise TaskError(f"'{env.name}' has no robot '{robot}'{suggest(robot, names)} (robots: {listing(names)})")
        self._channels = {(s.robot, s.channel): DrivenChannel(env, s) for s in env.actions.slices}
        self.arms: Sequence[DrivenArm] = tuple(
            arm for name in names if robot in (None, name) for arm in self._arms_of(name, solver)
        )
        if not self.arms:
            where = f"robot '{robot}'" if robot else f"task '{env.name}'"
            raise TaskError(
                f"{where} has no arm that a device can drive: a tool below the joints of a channel whose controller "
                f"takes joint positions (robots: {listing(names)}); set world.robots.NAME.actions.arm, for instance to "
                "joint_delta_position"
            )
        self.active = self.arms[0]

    def _arms_of(self, robot: str, solver: str) -> list[DrivenArm]:
        """Each tool with the channel that has most of the joints above it; of several tools on one arm the first."""
        world = self._env.engine.world
        model = next(r for r in world.robots if r.name == robot)
        own = {name: channel for (owner, name), channel in self._channels.items() if owner == robot}
        arms: dict[tuple[int, ...], DrivenArm] = {}
        for tool in model.tools:
            above = _joints_above(world, world.sites[model.tools[tool]].body)
            moving = {
                name: [j for j in channel.joints.tolist() if j in above]
                for name, channel in own.items()
                if channel.takes_joints and channel.channel.opened is None
            }
            name = max(moving, key=lambda name: len(moving[name]), default="")
            if not moving.get(name) or tuple(moving[name]) in arms:
                continue
            try:
                chain = Chain.from_world(world, robot, name, tool, joints=moving[name])
            except AnysimError:  # a coupled joint on the way: no arm
                continue
            gripper = next((c for c in own.values() if _is_gripper(c) and len(_below(world, c, chain))), None)
            arms[tuple(moving[name])] = DrivenArm(self._env, f"{robot}.{tool}", chain, own[name], gripper, solver)
        return list(arms.values())

    def begin(self) -> None:
        """The env has just been reset: hold everything where it is."""
        for channel in self._channels.values():
            channel.begin()
        for arm in self.arms:
            arm.begin()
        self.active = self.arms[0]

    def switch(self) -> None:
        """Hand the device to the next arm."""
        self.active = self.arms[(self.arms.index(self.active) + 1) % len(self.arms)]

    def act(self, wanted: DeviceInput, speed: float, turn: float) -> Array:
        """The action (1, A) of this control step."""
        if wanted.closed is not None:
            self.active.grip(wanted.closed)
        self.active.move(wanted, speed, turn)
        action = np.zeros((1, self._env.action_dim))
        for channel in self._channels.values():
            channel.write(action[0])
        return action


def _shortened(vector: Array, most: float) -> Array:
    length = float(np.linalg.norm(vector))
    return vector * (most / length) if length > most else vector


def _joints_above(world: World, body: int) -> set[int]:
    """The joints between a body and the world."""
    found: set[int] = set()
    while body >= 0:
        found.add(world.body_joint[body])
        body = world.bodies[body].parent
    return found


def _is_gripper(channel: DrivenChannel) -> bool:
    return channel.channel.opened is not None and channel.channel.closed is not None


def _below(world: World, channel: DrivenChannel, chain: Chain) -> Array:
    """The columns of a channel whose joints hang from the last joint of a chain."""
    bodies = [world.body_joint.index(joint) for joint in channel.joints.tolist()]
    return np.flatnonzero([int(chain.joints[-1]) in _joints_above(world, body) for body in bodies])
