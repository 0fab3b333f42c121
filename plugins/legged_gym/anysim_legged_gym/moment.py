"""One moment of all envs, in the quantities that rewards and observations are made of."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from anysim.conventions import Array
from anysim.engine.state import State
from anysim.math import pose as P
from anysim.model.frames import FixedFrame
from anysim_legged_gym.ground import Ground
from anysim_legged_gym.layout import Layout

DOWN = np.array([0.0, 0.0, -1.0])
TOUCHING = 1.0
"""[N] above which a link counts as touching."""


def _kept(array: Array) -> Array:
    """It, never to change again: what was handed out is of its moment."""
    array.setflags(write=False)
    return array


class Moment:
    """What the engine's state says of the robots, each quantity computed when it is first asked for.

    Velocities of the base are those of its frame's origin. Arrays are read-only and stay as they are.
    """

    def __init__(self, state: State, layout: Layout, ground: Ground, gravity: Array) -> None:
        self.state, self._layout, self._ground = state, layout, ground
        length = np.linalg.norm(gravity)
        self._down = gravity / length if length else DOWN

    @cached_property
    def base_pos(self) -> Array:
        return _kept(self.state.body_pose[:, self._layout.root, :3].copy())

    @cached_property
    def base_quat(self) -> Array:
        """With no negative scalar part, so that a rotation has one form."""
        return _kept(P.unsigned(self.state.body_pose[:, self._layout.root]))[:, 3:]

    @cached_property
    def base_euler(self) -> Array:
        return _kept(P.to_roll_pitch_yaw(self.base_quat))

    @cached_property
    def base_lin_vel_w(self) -> Array:
        return _kept(self.state.body_twist[:, self._layout.root, :3].copy())

    @cached_property
    def base_ang_vel_w(self) -> Array:
        return _kept(self.state.body_twist[:, self._layout.root, 3:].copy())

    @cached_property
    def in_base(self) -> Array:
        """(N, 3, 3): linear velocity, angular velocity and the direction of gravity, in the base's frame."""
        twist = self.state.body_twist[:, self._layout.root]
        rows = np.empty((len(twist), 3, 3))
        rows[:, :2], rows[:, 2] = twist.reshape(-1, 2, 3), self._down
        return _kept(P.rotate_inverse(self.base_quat[:, None], rows))

    @cached_property
    def dof_pos(self) -> Array:
        return _kept(self.state.joint_pos[:, self._layout.joints])

    @cached_property
    def dof_vel(self) -> Array:
        return _kept(self.state.joint_vel[:, self._layout.joints])

    @cached_property
    def torques(self) -> Array:
        return _kept(self.state.joint_effort[:, self._layout.joints])

    @cached_property
    def link_contact_forces(self) -> Array:
        return self.state.contact_force

    @cached_property
    def link_contact_states(self) -> Array:
        force = self.state.contact_force
        return _kept(P.dot(force, force) > TOUCHING**2)

    @cached_property
    def feet(self) -> tuple[Array, Array]:
        """Places and velocities (N, F, 3) of the feet, world frame."""
        return self.places(self._layout.feet)

    @cached_property
    def key_body_pos(self) -> Array:
        return self.places(self._layout.key_bodies)[0]

    @cached_property
    def measured_heights(self) -> Array:
        return _kept(self._ground.around(self.state.body_pose[:, self._layout.root]))

    @cached_property
    def heights_around_feet(self) -> Array:
        """(N, F, 9) [m] of the ground under and beside the feet."""
        place = self.feet[0]
        frames = np.empty((*place.shape[:2], 7))
        frames[..., :3], frames[..., 3:] = place, self.base_quat[:, None]
        found = self._ground.beside(frames.reshape(-1, 7))
        return _kept(found.reshape(*place.shape[:2], -1))

    def places(self, frames: Sequence[FixedFrame]) -> tuple[Array, Array]:
        """Places and velocities (N, K, 3) of frames of links, world frame."""
        bodies = [frame.body for frame in frames]
        pose, twist = self.state.body_pose[:, bodies], self.state.body_twist[:, bodies]
        arm = P.rotate(pose[..., 3:], np.array([frame.position for frame in frames]).reshape(-1, 3))
        return _kept(pose[..., :3] + arm), _kept(twist[..., :3] + P.cross(twist[..., 3:], arm))
