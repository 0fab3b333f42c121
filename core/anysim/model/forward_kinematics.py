"""Forward kinematics of a World over a batch, engine-free: the reference that engines are audited against."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import BodyKind, JointType, World


def joint_pose(world: World, joint: int, position: Array) -> Array:
    """Pose (..., 7) that a joint at `position` (...) adds after its body's rest frame.

    A revolute joint turns about `axis` through `anchor`, a prismatic one shifts along `axis`; both in the body's frame.
    """
    j = world.joints[joint]
    axis = np.asarray(j.axis)
    if j.type is JointType.PRISMATIC:
        shift = axis * position[..., None]
        return np.concatenate([shift, np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*position.shape, 4))], axis=-1)
    turn = P.from_axis_angle(np.broadcast_to(axis, (*position.shape, 3)), position)
    anchor = np.broadcast_to(np.asarray(j.anchor), (*position.shape, 3))
    return np.concatenate([anchor - P.rotate(turn, anchor), turn], axis=-1)


def forward_kinematics(world: World, roots: Array, joint_pos: Array) -> Array:
    """World poses (N, B, 7) of all bodies.

    Args:
        roots: (N, B, 7) of which only the rows of free and static bodies are read.
        joint_pos: (N, J) [rad] or [m].
    """
    poses = np.array(roots, dtype=np.float64)
    for i, body in enumerate(world.bodies):
        if body.kind is not BodyKind.LINK:
            continue
        rest = np.broadcast_to(np.array([*body.position, *body.quaternion]), (len(poses), 7))
        parent = poses[:, body.parent]
        poses[:, i] = P.compose(
            parent, P.compose(rest, joint_pose(world, world.body_joint[i], joint_pos[:, world.body_joint[i]]))
        )
    return poses
