"""Motion in MuJoCo's own coordinates, as gymnasium's tasks observe it."""

import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw
from anysim.math import pose as P
from anysim.task.scene import RobotView, SceneView
from anysim_schemas.base import Flag


def generalized_position(scene: SceneView, *, robot: RobotView, place: Flag = False) -> Array:
    """Place [m] and quaternion (scalar first) of the base, then the joints [rad, m]; x and y only with `place`."""
    base = robot.base
    where = base.position if place else base.position[:, 2:]
    return np.concatenate([where, wxyz_from_xyzw(base.quaternion), robot.joint_pos], axis=1)


def generalized_velocity(scene: SceneView, *, robot: RobotView) -> Array:
    """Velocity of the base [m/s, world axes], its rate [rad/s, own axes], then the joints' [rad/s, m/s]."""
    base = robot.base
    rate = P.rotate_inverse(base.quaternion, base.twist[:, 3:])
    return np.concatenate([base.twist[:, :3], rate, robot.joint_vel], axis=1)


def generalized_force(scene: SceneView, *, robot: RobotView) -> Array:
    """What the drives do at each joint of a robot [N m, N]."""
    return scene.state.joint_effort[scene.rows, robot.joints]


def forward_speed(scene: SceneView, *, robot: RobotView) -> Array:
    """Velocity of the base along the world's x axis [m/s]."""
    return robot.base.twist[:, 0]
