"""Observation terms of a robot's own state: base, tool, channels. A robot alone in its world need not be named."""

from typing import Literal

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.math import pose as P
from anysim.task.scene import RobotView, SceneView

_DOWN = np.array([0.0, 0.0, -1.0])


def base_pose(scene: SceneView, *, robot: RobotView) -> Array:
    """Pose of the base's frame in the world [m, xyzw]; the quaternion's scalar part is never negative."""
    return P.unsigned(robot.base.pose)


def base_lin_vel(scene: SceneView, *, robot: RobotView) -> Array:
    """Velocity of the base's origin in the base's own axes [m/s]."""
    return P.rotate_inverse(robot.base.quaternion, robot.base.twist[:, :3])


def base_ang_vel(scene: SceneView, *, robot: RobotView) -> Array:
    """Rate of the base in its own axes [rad/s], as a gyroscope there reads."""
    return P.rotate_inverse(robot.base.quaternion, robot.base.twist[:, 3:])


def projected_gravity(scene: SceneView, *, robot: RobotView) -> Array:
    """The world's direction downwards in the base's axes: (0, 0, -1) upright. A measure of tilt that ignores yaw."""
    turn = robot.base.quaternion
    return P.rotate_inverse(turn, np.broadcast_to(_DOWN, (len(turn), 3)))


def tool_pose(
    scene: SceneView, *, robot: RobotView, tool: str = "tool", frame: Literal["world", "base"] = "world"
) -> Array:
    """Pose of a tool in the world or in the base's frame [m, xyzw]; the quaternion's scalar part is never negative."""
    pose = robot.tool(tool).pose
    return P.unsigned(pose if frame == "world" else P.compose(P.inverse(robot.base.pose), pose))


def tool_twist(
    scene: SceneView, *, robot: RobotView, tool: str = "tool", frame: Literal["world", "base"] = "world"
) -> Array:
    """Velocity of a tool's origin and its rate [m/s, rad/s]: in the world, or as seen from the base, in its axes."""
    moving = robot.tool(tool)
    if frame == "world":
        return moving.twist
    base = robot.base
    arm = moving.position - base.position
    linear = moving.twist[:, :3] - base.twist[:, :3] - P.cross(base.twist[:, 3:], arm)
    angular = moving.twist[:, 3:] - base.twist[:, 3:]
    turn = base.quaternion
    return np.concatenate([P.rotate_inverse(turn, linear), P.rotate_inverse(turn, angular)], axis=1)


def channel_joint_pos(
    scene: SceneView, *, robot: RobotView, channel: str = "arm", relative: Literal["home", "zero"] = "home"
) -> Array:
    """Joint positions of a channel [rad, m], less the nominal home or as they are."""
    own = robot.channel_columns(channel)
    position = scene.state.joint_pos[scene.rows][:, own.joints]
    return position if relative == "zero" else position - own.home


def channel_joint_vel(scene: SceneView, *, robot: RobotView, channel: str = "arm") -> Array:
    """Joint velocities of a channel [rad/s, m/s]."""
    return scene.state.joint_vel[scene.rows][:, robot.channel_columns(channel).joints]


def channel_action(scene: SceneView, *, robot: RobotView, channel: str = "arm") -> Array:
    """The last action of a channel, clipped to its bounds; zero right after a reset."""
    robot.channel(channel)
    columns = scene.action_columns.get(f"{robot.name}.{channel}")
    if columns is None:
        raise TaskError(
            f"the channel '{robot.name}.{channel}' has no controller, so it has no action; add "
            f"world.robots.{robot.name}.actions.{channel} (channels with one: {listing(scene.action_columns)})"
        )
    return scene.last_action[scene.rows][:, columns]


def commanded_velocity(scene: SceneView, *, robot: RobotView, channel: str = "base") -> Array:
    """The velocities that the drives of a channel are commanded now [rad/s, m/s]; 0 where only positions are."""
    return scene.engine.control.velocity[scene.rows][:, robot.channel_columns(channel).drives]
