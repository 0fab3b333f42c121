"""RobotManager: initial joint positions, and actions from the robots' channels to drive targets."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from anysim import registry
from anysim.controllers.base import ChannelView, Controller
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import SpecError, SpecIssue, TaskError, listing, suggest
from anysim.managers.base import Manager
from anysim.managers.overrides import WORLD, Overridable, drawn
from anysim.managers.streams import Origin
from anysim.managers.values import draw_rows
from anysim.signatures import options_model
from anysim.world.model import World


class ActionSlice(NamedTuple):
    """Which columns of the action belong to a channel."""

    robot: str
    channel: str
    start: int
    stop: int
    controller: Controller


class RobotManager(Manager):
    """All robots of an env. The action is one flat vector: robots in order, channels in the order of `actions`."""

    name = "robot"

    def build(self, world: World) -> None:
        self._world = world
        self._channels: list[tuple[str, str, ChannelView]] = []
        issues: list[SpecIssue] = []
        for robot in world.robots:
            for channel_name in self.spec.world.robots[robot.name].actions:
                channel = robot.channels.get(channel_name)
                if channel is None:
                    path = f"world.robots.{robot.name}.actions.{channel_name}"
                    hint = suggest(channel_name, list(robot.channels))
                    issues.append(
                        SpecIssue(
                            "", path, f"{robot.model} has no such channel{hint} (channels: {listing(robot.channels)})"
                        )
                    )
                    continue
                self._channels.append((robot.name, channel_name, ChannelView.of(world, channel)))
        if issues:
            raise SpecError(issues)

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        n = engine.num_envs
        self.slices: list[ActionSlice] = []
        start = 0
        for robot, channel, view in self._channels:
            action = self.spec.world.robots[robot].actions[channel]
            controller_class: type[Controller] = registry.load("controllers", action.controller)
            params = options_model(controller_class).model_validate(action.params)
            values = {name: getattr(params, name) for name in type(params).model_fields}
            controller = controller_class(view, n, **values)
            self.slices.append(ActionSlice(robot, channel, start, start + controller.dim, controller))
            start += controller.dim
        self.action_dim = start
        self.action_low = np.concatenate([s.controller.low for s in self.slices] or [np.zeros(0)])
        self.action_high = np.concatenate([s.controller.high for s in self.slices] or [np.zeros(0)])
        initial = [self._world.joints[a.joint].initial for a in self._world.actuators]
        self._targets = np.tile(np.array(initial, dtype=float), (n, 1))

    def reset(self, env_ids: Array) -> None:
        """Home positions, with the noise of the spec on the arm's joints, at rest; drives hold them."""
        for robot in self._world.robots:
            spec = self.spec.world.robots[robot.name]
            entity = self.engine.index.entity(robot.name)
            joints = np.arange(entity.joint_start, entity.joint_stop)
            home = np.array([self._world.joints[j].initial for j in joints])
            position = np.tile(home, (len(env_ids), 1))
            deviation = draw_rows(
                spec.home_noise, f"robot/{robot.name}/home_noise_std", self.streams, env_ids,
                source=f"world.robots.{robot.name}.home_noise",
            )  # fmt: skip
            if deviation.any():
                for column, joint in enumerate(joints):
                    self._add_noise(position, column, int(joint), robot.name, deviation, env_ids)
            followers = [c for c, j in enumerate(joints) if self._world.joints[j].mimic is not None]
            leaders = [c for c in range(len(joints)) if c not in followers]
            self.engine.set_joint_state(
                position[:, leaders], np.zeros((len(env_ids), len(leaders))), env_ids, joints[leaders]
            )
            for number, actuator in enumerate(self._world.actuators):
                if entity.joint_start <= actuator.joint < entity.joint_stop:
                    self._targets[env_ids, number] = position[:, actuator.joint - entity.joint_start]
        for s in self.slices:
            s.controller.reset(env_ids, self._targets[np.ix_(env_ids, s.controller.channel.actuators)])
        self.engine.set_control(position=self._targets[env_ids], env_ids=env_ids)

    def overridable(self) -> list[Overridable]:
        robots = self.spec.world.robots
        return [
            e for r in self._world.robots for e in drawn(f"{WORLD}robots.{r.name}", robots[r.name], ("home_noise",))
        ]

    def _add_noise(
        self, position: Array, column: int, joint: int, robot: str, deviation: Array, env_ids: Array
    ) -> None:
        """Only joints of channels named base or arm are disturbed: a gripper starts as its home says."""
        found = self._world.joints[joint]
        arm = any(
            joint in channel.joints
            for owner in self._world.robots if owner.name == robot
            for name, channel in owner.channels.items() if channel.opened is None
        )  # fmt: skip
        if not arm:
            return
        for row, env in enumerate(env_ids):
            stream = f"robot/{found.name}/home_noise"
            noise = deviation[row] * self.streams.generator(int(env), stream).standard_normal()
            self.streams.note(int(env), stream, noise, Origin(stream, f"world.robots.{robot}.home_noise"))
            position[row, column] = min(max(position[row, column] + noise, found.lower), found.upper)

    def act(self, action: Array, env_ids: Array | None) -> None:
        """Turn actions (N, A) into drive targets of all envs, or of `env_ids`; the others keep their commands."""
        for s in self.slices:
            rows = action[:, s.start : s.stop] if env_ids is None else action[env_ids, s.start : s.stop]
            targets = s.controller.apply(rows, env_ids)
            if env_ids is None:
                self._targets[:, s.controller.channel.columns] = targets
            else:
                self._targets[np.ix_(env_ids, s.controller.channel.actuators)] = targets
        if self.slices:
            self.engine.set_control(position=self._targets)

    def slice_of(self, robot: str, channel: str) -> ActionSlice:
        """The part of the action that belongs to a robot's channel.

        Raises:
            TaskError: the world gives that channel no controller.
        """
        for s in self.slices:
            if (s.robot, s.channel) == (robot, channel):
                return s
        known = [f"{s.robot}.{s.channel}" for s in self.slices]
        raise TaskError(
            f"'{robot}.{channel}' has no controller; add world.robots.{robot}.actions.{channel} "
            f"(channels with one: {listing(known)})"
        )

    def validated(self, action: Array) -> Array:
        """The action as float64 (N, A), clipped to the channels' bounds.

        Raises:
            TaskError: another shape, or a value that is not finite.
        """
        array = np.asarray(action, dtype=np.float64)
        if array.shape != (self.engine.num_envs, self.action_dim):
            raise TaskError(
                f"the action must have shape ({self.engine.num_envs}, {self.action_dim}), got {array.shape}"
            )
        clipped = np.minimum(np.maximum(array, self.action_low), self.action_high)
        if not np.isfinite(clipped).all() or np.isnan(array).any():
            raise TaskError("the action holds a value that is not a number")
        return clipped

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        data = {"targets": self._targets[env_ids]}
        for s in self.slices:
            data |= {f"{s.robot}.{s.channel}.{k}": v for k, v in s.controller.snapshot(env_ids).items()}
        return data

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._targets[env_ids] = data["targets"]
        for s in self.slices:
            prefix = f"{s.robot}.{s.channel}."
            s.controller.restore(env_ids, {k[len(prefix) :]: v for k, v in data.items() if k.startswith(prefix)})
