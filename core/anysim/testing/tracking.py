"""Worlds of one robot, a puppet without an engine, and circles, for tests and benchmarks of controllers of tools."""

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple, Self, cast

import numpy as np

from anysim import registry
from anysim.api import make
from anysim.compile.world import compile_world
from anysim.controllers.base import ChannelView, Command, Controller
from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array
from anysim.engine.state import State
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import BodyKind, World
from anysim.task.env import TaskEnv
from anysim_schemas.engine import PhysicsSpec
from anysim_schemas.run import WorldSpec


def robot_world(
    robot: str, *, physics: Mapping[str, Any] | None = None, objects: Mapping[str, Any] | None = None, **spec: Any
) -> World:
    """A World with the ground and one robot of the catalogue, named `robot`."""
    world = {"terrain": "plane", "robots": {"robot": {"robot": robot, **spec}}, **(objects or {})}
    return compile_world(WorldSpec.model_validate(world), physics=PhysicsSpec(**(physics or {"control_dt": 0.02})))


def bolted(world: World) -> World:
    """The World with its robot's root fixed where it is, for tests of arms whose robot would roll or fall over."""
    root = next(entity.root for entity in world.entities if entity.name == "robot")
    bodies = list(world.bodies)
    bodies[root] = replace(bodies[root], kind=BodyKind.STATIC)
    return replace(world, bodies=tuple(bodies))


class Puppet:
    """Envs with one robot whose drives are perfect.

    After a control step the joints are where the controller's reference is. Nothing else moves, nothing has weight.
    """

    def __init__(
        self, world: World, controller: str, *, channel: str = "arm", num_envs: int = 1, **params: Any
    ) -> None:
        self.world, self.robot = world, ControlledRobot(world, "robot")
        self.view = ChannelView.of(world, world.robots[0].channels[channel], self.robot)
        made: type[Controller] = registry.load("controllers", controller)
        self.controller: Any = made(self.view, num_envs, **params)
        self.columns = self.robot.joints[self.view.joint_columns]
        self.joint_pos = np.tile(np.array([joint.initial for joint in world.joints]), (num_envs, 1))
        self.roots = np.tile(np.array([[*b.position, *b.quaternion] for b in world.bodies]), (num_envs, 1, 1))
        self.see()

    def see(self) -> None:
        """Show the controller where everything is."""
        for index, joint in enumerate(self.world.joints):
            if joint.mimic is not None:
                leader = self.joint_pos[:, joint.mimic.joint]
                self.joint_pos[:, index] = joint.mimic.multiplier * leader + joint.mimic.offset
        body_pose = forward_kinematics(self.world, self.roots, self.joint_pos)
        seen = SimpleNamespace(
            joint_pos=self.joint_pos,
            joint_vel=np.zeros_like(self.joint_pos),
            body_pose=body_pose,
            body_twist=np.zeros((*body_pose.shape[:2], 6)),
        )
        self.robot.see(cast(State, seen))

    def reset(self) -> Self:
        """All drives hold the joints where they are."""
        self.see()
        self.controller.reset(np.arange(len(self.joint_pos)), self.joint_pos[:, self.columns])
        return self

    def step(self, action: Array, env_ids: Array | None = None) -> Command:
        """One control step of all envs, or some."""
        rows = slice(None) if env_ids is None else env_ids
        action = np.clip(action, self.controller.low, self.controller.high)
        command = self.controller.apply(np.atleast_2d(action), env_ids)
        at = np.ix_(np.arange(len(self.joint_pos))[rows], self.columns)
        move = 0.0 if command.velocity is None else 0.5 * self.robot.control_dt * command.velocity
        self.joint_pos[at] = command.position + move
        self.see()
        return command

    def tool(self, name: str = "tool") -> Array:
        """(N, 7) pose of a tool in the world."""
        return self.robot.frame_pose(None, name)


class Circle(NamedTuple):
    """A tool's path: a circle in a plane, reached from its centre's rim at a speed that grows from zero.

    Attributes:
        radius: [m]
        speed: [m/s] along the circle.
        rise: [s] in which the speed grows.
    """

    radius: float = 0.05
    speed: float = 0.2
    rise: float = 0.5

    def pose(self, start: Array, time: float, normal: Array | None = None) -> Array:
        """The target (..., 7) `time` [s] after the tool was at `start` (..., 7), which is on the rim.

        The plane holds the vertical and the direction across the tool's: it can be drawn in front of any robot.
        """
        share = min(max(time / self.rise, 0.0), 1.0)
        # a smooth start: the speed's rise is a cubic, its integral a quartic
        length = self.speed * (self.rise * (share**3 - 0.5 * share**4) + max(time - self.rise, 0.0))
        angle = length / self.radius
        out = np.array(start)
        across = np.array([0.0, 1.0, 0.0]) if normal is None else normal
        out[..., :3] += self.radius * ((np.cos(angle) - 1.0) * np.array([0.0, 0.0, 1.0]) + np.sin(angle) * across)
        return out


class Tracking(NamedTuple):
    """How well a tool followed: root mean square and largest distance [m] from its target, and turn [rad]."""

    rms: float
    worst: float
    turn: float


def errors(targets: Array, poses: Array) -> Tracking:
    """Of poses (n, 7) that were to be at targets (n, 7)."""
    distance = P.norm(targets[:, :3] - poses[:, :3])
    turn = P.angle_between(poses[:, 3:], targets[:, 3:])
    return Tracking(float(np.sqrt((distance**2).mean())), float(distance.max()), float(np.sqrt((turn**2).mean())))


def tool_env(robot: str, controller: str, engine: str, *, params: Mapping[str, Any] | None = None) -> TaskEnv:
    """An env with one robot of the catalogue, named `robot`, whose arm has a controller of tools."""
    spec = {
        "engine": engine,
        "physics": {"dt": 0.002, "control_dt": 0.02},
        "world": {
            "terrain": "plane",
            "robots": {
                "robot": {"robot": robot, "actions": {"arm": {"controller": controller, "params": dict(params or {})}}}
            },
        },
        "task": {"horizon": 10_000, "observations": {"policy": ["joint_pos"]}},
    }
    return make(spec, seed=0)


def follow(robot: str, controller: str, engine: str, circle: Circle, *, seconds: float = 2.0) -> Tracking:
    """Move the arm's tool along a circle from where it is at home, and see how far off its path it was."""
    with tool_env(robot, controller, engine) as env:
        env.reset(seed=0)
        controlled, control_dt = env.actions.slices[0].controller.robot, env.engine.world.physics.control_dt
        tool = next(iter(controlled.robot.tools))

        def pose() -> Array:
            controlled.see(env.engine.get_state())
            return controlled.frame_pose(None, tool)

        start = pose()
        targets, poses = [], []
        for step in range(round(seconds / control_dt)):
            target = circle.pose(start, (step + 1) * control_dt)
            env.step(target)
            targets.append(target[0])
            poses.append(pose()[0])
    return errors(np.array(targets), np.array(poses))
