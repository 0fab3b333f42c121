"""Observation terms: `(scene, *, parameters) -> (n, k)`."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.view import Frame, RobotView, SceneView

__all__ = ["frame_pose", "frame_twist", "goal_position", "joint_pos", "joint_vel", "last_action", "offset"]


def joint_pos(scene: SceneView, *, robot: RobotView) -> Array:
    """Joint positions of a robot [rad, m]."""
    return robot.joint_pos


def joint_vel(scene: SceneView, *, robot: RobotView) -> Array:
    """Joint velocities of a robot [rad/s, m/s]."""
    return robot.joint_vel


def frame_pose(scene: SceneView, *, frame: Frame) -> Array:
    """Pose of a frame in the world [m, xyzw]; the quaternion's scalar part is never negative."""
    pose = frame.pose
    return np.concatenate([pose[:, :3], np.where(pose[:, 6:] < 0, -pose[:, 3:], pose[:, 3:])], axis=1)


def frame_twist(scene: SceneView, *, frame: Frame) -> Array:
    """Velocity of a frame's origin and its rate, world axes [m/s, rad/s]."""
    return frame.twist


def goal_position(scene: SceneView, *, goal: Frame) -> Array:
    """Position of a goal in the world [m]."""
    return goal.position


def offset(scene: SceneView, *, a: Frame, b: Frame) -> Array:
    """From a to b, in the axes of a [m]."""
    return P.rotate_inverse(a.quaternion, b.position - a.position)


def last_action(scene: SceneView) -> Array:
    """The last action, clipped to its bounds; zero right after a reset."""
    return scene.last_action[scene.rows]
