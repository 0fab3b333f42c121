"""RobotManager: where robots stand and how they begin, and actions from their channels to drive targets."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from anysim import registry
from anysim.controllers.base import ChannelView, Controller
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import SpecError, SpecIssue, TaskError, listing, suggest
from anysim.managers.base import Manager
from anysim.managers.noise import DelayLine, longest_delay, noise_rows, note_noise
from anysim.managers.overrides import WORLD, Overridable, drawn, random_fields
from anysim.managers.robot_dynamics import RobotDynamics
from anysim.managers.streams import Origin
from anysim.managers.values import draw_rows, is_random
from anysim.math import pose as P
from anysim.signatures import options_model
from anysim.world.model import BodyKind, World
from anysim_schemas.robots import ActionSpec, RobotSpec


class ActionSlice(NamedTuple):
    """Which columns of the action belong to a channel."""

    robot: str
    channel: str
    start: int
    stop: int
    controller: Controller
    spec: ActionSpec
    line: DelayLine | None
    """What was asked for in the last steps, where it acts late."""


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
        self._dynamics = {
            robot.name: RobotDynamics(world, robot.name, self.spec.world.robots[robot.name].dynamics, self.streams)
            for robot in world.robots
        }

    def parameters(self) -> Iterable[tuple[str, str]]:
        return [change for dynamics in self._dynamics.values() for change in dynamics.parameters()]

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
            longest = longest_delay(action.delay)
            line = DelayLine(n, controller.dim, longest) if longest else None
            stop = start + controller.dim
            self.slices.append(ActionSlice(robot, channel, start, stop, controller, action, line))
            start += controller.dim
        self.action_dim = start
        self.action_low = np.concatenate([s.controller.low for s in self.slices] or [np.zeros(0)])
        self.action_high = np.concatenate([s.controller.high for s in self.slices] or [np.zeros(0)])
        initial = [self._world.joints[a.joint].initial for a in self._world.actuators]
        self._targets = np.tile(np.array(initial, dtype=float), (n, 1))
        self._ticks = np.zeros(n, dtype=np.int64)
        """Control steps since the reset (N,)."""

    def reset(self, env_ids: Array) -> None:
        """Where bases stand, home positions with the noise of the spec on the arm's joints; drives hold them."""
        self._ticks[env_ids] = 0
        for robot in self._world.robots:
            spec = self.spec.world.robots[robot.name]
            entity = self.engine.index.entity(robot.name)
            self._dynamics[robot.name].write(self.engine, env_ids)
            self._place_base(robot.name, spec, env_ids)
            joints = np.arange(entity.joint_start, entity.joint_stop)
            home = np.array([self._world.joints[j].initial for j in joints])
            position = np.tile(home, (len(env_ids), 1))
            velocity = np.zeros_like(position)
            for column, joint in enumerate(joints):
                self._draw_start(robot.name, spec, int(joint), position[:, column], velocity[:, column], env_ids)
            deviation = draw_rows(
                spec.home_noise, f"robot/{robot.name}/home_noise_std", self.streams, env_ids,
                source=f"world.robots.{robot.name}.home_noise",
            )  # fmt: skip
            if deviation.any():
                for column, joint in enumerate(joints):
                    self._add_noise(position, column, int(joint), robot.name, deviation, env_ids)
            followers = [c for c, j in enumerate(joints) if self._world.joints[j].mimic is not None]
            leaders = [c for c in range(len(joints)) if c not in followers]
            self.engine.set_joint_state(position[:, leaders], velocity[:, leaders], env_ids, joints[leaders])
            for number, actuator in enumerate(self._world.actuators):
                if entity.joint_start <= actuator.joint < entity.joint_stop:
                    self._targets[env_ids, number] = position[:, actuator.joint - entity.joint_start]
        for s in self.slices:
            self._reset_imperfections(s, env_ids)
            s.controller.reset(env_ids, self._targets[np.ix_(env_ids, s.controller.channel.actuators)])
        self.engine.set_control(position=self._targets[env_ids], env_ids=env_ids)

    def overridable(self) -> list[Overridable]:
        entries: list[Overridable] = []
        for robot in self._world.robots:
            spec, path = self.spec.world.robots[robot.name], f"{WORLD}robots.{robot.name}"
            entries += drawn(path, spec, ("home_noise",)) + random_fields(path, spec, ("position", "yaw"))
            entries += random_fields(f"{path}.dynamics", spec.dynamics)
            for channel, action in spec.actions.items():
                entries += random_fields(f"{path}.actions.{channel}", action, ("delay",))
        return entries

    def _place_base(self, robot: str, spec: RobotSpec, env_ids: Array) -> None:
        """Put a robot's base where this episode wants it: as drawn, on the ground of its env."""
        origin = self.board.origin[env_ids]
        if not (is_random(spec.position) or is_random(spec.yaw) or origin.any()):
            return  # the World has it there
        path = f"world.robots.{robot}"
        place = draw_rows(
            spec.position, f"robot/{robot}/position", self.streams, env_ids, source=f"{path}.position"
        )  # fmt: skip
        yaw = draw_rows(spec.yaw, f"robot/{robot}/yaw", self.streams, env_ids, source=f"{path}.yaw")
        turn = P.from_roll_pitch_yaw(np.stack([np.zeros_like(yaw), np.zeros_like(yaw), yaw], axis=1))
        pose = np.concatenate([place + origin, turn], axis=1)[:, None]
        root = self.engine.index.entity(robot).root
        free = self._world.bodies[root].kind is BodyKind.FREE
        self.engine.set_body_state(pose, np.zeros((len(env_ids), 1, 6)) if free else None, env_ids, [root])

    def _draw_start(
        self, robot: str, spec: RobotSpec, joint: int, position: Array, velocity: Array, env_ids: Array
    ) -> None:
        """Write a joint's home and velocity (E,) where the spec gives them as values."""
        found = self._world.joints[joint]
        name, path = found.name.removeprefix(f"{robot}."), f"world.robots.{robot}"
        if is_random(spec.home.get(name)):
            drawn = draw_rows(
                spec.home[name], f"robot/{robot}/home/{name}", self.streams, env_ids, source=f"{path}.home.{name}"
            )
            position[:] = np.clip(drawn, found.lower, found.upper)
        if name in spec.home_velocity:
            velocity[:] = draw_rows(
                spec.home_velocity[name], f"robot/{robot}/home_velocity/{name}", self.streams, env_ids,
                source=f"{path}.home_velocity.{name}",
            )  # fmt: skip

    def _reset_imperfections(self, s: ActionSlice, env_ids: Array) -> None:
        """Draw the delay of a channel, and say that it has noise."""
        stream, path = f"robot/{s.robot}/{s.channel}", f"world.robots.{s.robot}.actions.{s.channel}"
        if s.line is not None:
            delay = draw_rows(s.spec.delay, f"{stream}/delay", self.streams, env_ids, source=f"{path}.delay")
            s.line.reset(env_ids, delay.astype(np.int64))
        note_noise(s.spec.noise, f"{stream}/noise", self.streams, env_ids, f"{path}.noise")

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
            rows, obeying = self._imperfect(s, rows, env_ids)
            if obeying is not None and len(obeying) == 0:
                continue
            targets = s.controller.apply(rows, obeying)
            if obeying is None:
                self._targets[:, s.controller.channel.columns] = targets
            else:
                self._targets[np.ix_(obeying, s.controller.channel.actuators)] = targets
        if env_ids is None:
            self._ticks += 1
        else:
            self._ticks[env_ids] += 1
        if self.slices:
            self.engine.set_control(position=self._targets)

    def _imperfect(self, s: ActionSlice, rows: Array, env_ids: Array | None) -> tuple[Array, Array | None]:
        """What reaches the controller of what was asked for, and the envs for which anything does by now."""
        if s.line is None and s.spec.noise is None:
            return rows, env_ids
        ids = np.arange(self.engine.num_envs) if env_ids is None else env_ids
        if s.line is not None:
            s.line.write(ids, self._ticks[ids], rows)
            there = s.line.arrived(ids, self._ticks[ids])
            rows = s.line.read(ids, self._ticks[ids])[there]
            ids, env_ids = ids[there], env_ids if there.all() else ids[there]
        if s.spec.noise is not None:
            name = f"robot/{s.robot}/{s.channel}/noise"
            noisy = rows + noise_rows(s.spec.noise, name, self.streams, ids, self._ticks[ids], rows.shape[1])
            rows = np.clip(noisy, s.controller.low, s.controller.high)
        return rows, env_ids

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
        data = {"targets": self._targets[env_ids], "ticks": self._ticks[env_ids]}
        for s in self.slices:
            if s.line is not None:
                data[f"delayed.{s.robot}.{s.channel}.delay"] = s.line.delay[env_ids]
                data[f"delayed.{s.robot}.{s.channel}.rows"] = s.line.rows[env_ids]
            data |= {f"{s.robot}.{s.channel}.{k}": v for k, v in s.controller.snapshot(env_ids).items()}
        return data

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        self._targets[env_ids], self._ticks[env_ids] = data["targets"], data["ticks"]
        for s in self.slices:
            if s.line is not None:
                s.line.delay[env_ids] = data[f"delayed.{s.robot}.{s.channel}.delay"]
                s.line.rows[env_ids] = data[f"delayed.{s.robot}.{s.channel}.rows"]
            prefix = f"{s.robot}.{s.channel}."
            s.controller.restore(env_ids, {k[len(prefix) :]: v for k, v in data.items() if k.startswith(prefix)})
