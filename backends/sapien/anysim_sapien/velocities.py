"""Twists of links from joint velocities: sums over the joints between a link and its root, in one product."""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import BodyKind, JointType, World


class LinkVelocities:
    """The constants of a World's links, made once."""

    def __init__(self, world: World) -> None:
        self._links = np.array([i for i, b in enumerate(world.bodies) if b.kind is BodyKind.LINK], dtype=int)
        self._body = np.array([j.body for j in world.joints], dtype=int)
        self._axis = np.array([j.axis for j in world.joints], dtype=float).reshape(-1, 3)
        self._anchor = np.array([j.anchor for j in world.joints], dtype=float).reshape(-1, 3)
        self._turns = np.array([j.type is JointType.REVOLUTE for j in world.joints], dtype=float)[:, None]
        root = list(range(len(world.bodies)))
        moved_by = np.zeros((len(world.bodies), len(world.joints)))
        for i, body in enumerate(world.bodies):
            if body.kind is BodyKind.LINK:
                root[i] = root[body.parent]
                moved_by[i] = moved_by[body.parent]
                moved_by[i, world.body_joint[i]] = 1.0
        self._root = np.array(root, dtype=int)[self._links]
        self._moved_by = moved_by[self._links]

    def fill(self, twists: Array, poses: Array, joint_vel: Array) -> None:
        """Write the rows of the links into twists (..., B, 6), whose root rows are there.

        Poses are (..., B, 7), joint_vel (..., J). A rigid motion is its angular rate and the velocity of whatever
        passes the world's origin; both add along a chain of joints.
        """
        turn = poses[..., self._body, 3:]
        axis = P.rotate(turn, np.broadcast_to(self._axis, (*turn.shape[:-1], 3))) * joint_vel[..., None]
        anchor = poses[..., self._body, :3] + P.rotate(turn, np.broadcast_to(self._anchor, (*turn.shape[:-1], 3)))
        rate = axis * self._turns
        motion = np.concatenate([P.cross(anchor, rate) + axis * (1.0 - self._turns), rate], axis=-1)
        total = self._moved_by @ motion
        root = twists[..., self._root, :]
        total[..., :3] += root[..., :3] - P.cross(root[..., 3:], poses[..., self._root, :3])
        total[..., 3:] += root[..., 3:]
        twists[..., self._links, :3] = total[..., :3] + P.cross(total[..., 3:], poses[..., self._links, :3])
        twists[..., self._links, 3:] = total[..., 3:]
