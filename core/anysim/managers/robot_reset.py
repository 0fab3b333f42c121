"""RobotResetManager: where robots stand and how they begin an episode."""

from collections.abc import Iterable

import numpy as np

from anysim.conventions import Array
from anysim.managers.base import WORLD, Manager, Overridable, drawn, random_fields
from anysim.managers.robot_parameters import RobotParameters
from anysim.math import pose as P
from anysim.model.world import BodyKind, World
from anysim.randomization.draw import draw_rows, is_random
from anysim.randomization.streams import Origin
from anysim_schemas.robots import RobotSpec


class RobotResetManager(Manager):
    """Draws and writes what robots are like, where their bases stand and how their joints begin; drives hold that."""

    name = "robot"

    def build(self, world: World) -> None:
        self._world = world
        self._initial = np.array([world.joints[a.joint].initial for a in world.actuators], dtype=float)
        self._parameters = {
            robot.name: RobotParameters(world, robot.name, self.spec.world.robots[robot.name].dynamics, self.streams)
            for robot in world.robots
        }

    def parameters(self) -> Iterable[tuple[str, str]]:
        return [change for robot in self._parameters.values() for change in robot.parameters()]

    def reset(self, env_ids: Array) -> None:
        """Where bases stand, home positions with the noise of the spec on the arm's joints; drives hold them."""
        targets = np.tile(self._initial, (len(env_ids), 1))
        for robot in self._world.robots:
            spec = self.spec.world.robots[robot.name]
            entity = self.engine.index.entity(robot.name)
            self._parameters[robot.name].write(self.engine, env_ids)
            self._place_base(robot.name, spec, env_ids)
            joints = np.arange(entity.joint_start, entity.joint_stop)
            home = np.array([self._world.joints[j].initial for j in joints])
            position = np.tile(home, (len(env_ids), 1))
            velocity = np.zeros_like(position)
            for column, joint in enumerate(joints):
                self._draw_start(robot.name, spec, int(joint), position[:, column], velocity[:, column], env_ids)
            deviation = draw_rows(
                spec.home_noise,
                f"robot/{robot.name}/home_noise_std",
                self.streams,
                env_ids,
                source=f"world.robots.{robot.name}.home_noise",
            )
            if deviation.any():
                for column, joint in enumerate(joints):
                    self._add_noise(position, column, int(joint), robot.name, deviation, env_ids)
            followers = [c for c, j in enumerate(joints) if self._world.joints[j].mimic is not None]
            leaders = [c for c in range(len(joints)) if c not in followers]
            self.engine.set_joint_state(position[:, leaders], velocity[:, leaders], env_ids, joints[leaders])
            for number, actuator in enumerate(self._world.actuators):
                if entity.joint_start <= actuator.joint < entity.joint_stop:
                    targets[:, number] = position[:, actuator.joint - entity.joint_start]
        if self._world.actuators:
            self.engine.set_control(position=targets, env_ids=env_ids)

    def overridable(self) -> list[Overridable]:
        entries: list[Overridable] = []
        for robot in self._world.robots:
            spec, path = self.spec.world.robots[robot.name], f"{WORLD}robots.{robot.name}"
            entries += drawn(path, spec, ("home_noise",)) + random_fields(path, spec, ("position", "yaw"))
            entries += random_fields(f"{path}.dynamics", spec.dynamics)
        return entries

    def _place_base(self, robot: str, spec: RobotSpec, env_ids: Array) -> None:
        """Put a robot's base where this episode wants it: as drawn, on the ground of its env."""
        origin = self.episodes.origin[env_ids]
        if not (is_random(spec.position) or is_random(spec.yaw) or origin.any()):
            self.episodes.bases.pop(robot, None)
            return  # the World has it there
        path = f"world.robots.{robot}"
        place = draw_rows(spec.position, f"robot/{robot}/position", self.streams, env_ids, source=f"{path}.position")
        yaw = draw_rows(spec.yaw, f"robot/{robot}/yaw", self.streams, env_ids, source=f"{path}.yaw")
        turn = P.from_roll_pitch_yaw(np.stack([np.zeros_like(yaw), np.zeros_like(yaw), yaw], axis=1))
        entry = self.engine.index.robot(robot).entry
        place[:, 2] += 0.0 if entry is None else entry.base_height
        pose = np.concatenate([place + origin, turn], axis=1)
        self.episodes.bases.setdefault(robot, np.zeros((self.engine.num_envs, 7)))[env_ids] = pose
        root = self.engine.index.entity(robot).root
        free = self._world.bodies[root].kind is BodyKind.FREE
        self.engine.set_body_state(pose[:, None], np.zeros((len(env_ids), 1, 6)) if free else None, env_ids, [root])

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
                spec.home_velocity[name],
                f"robot/{robot}/home_velocity/{name}",
                self.streams,
                env_ids,
                source=f"{path}.home_velocity.{name}",
            )

    def _add_noise(
        self, position: Array, column: int, joint: int, robot: str, deviation: Array, env_ids: Array
    ) -> None:
        """Only joints of channels named base or arm are disturbed: a gripper starts as its home says."""
        found = self._world.joints[joint]
        arm = any(
            joint in channel.joints
            for owner in self._world.robots
            if owner.name == robot
            for name, channel in owner.channels.items()
            if channel.opened is None
        )
        if not arm:
            return
        for row, env in enumerate(env_ids):
            stream = f"robot/{found.name}/home_noise"
            noise = deviation[row] * self.streams.shared_generator(int(env), stream).standard_normal()
            self.streams.note(int(env), stream, noise, Origin(stream, f"world.robots.{robot}.home_noise"))
            position[row, column] = min(max(position[row, column] + noise, found.lower), found.upper)
