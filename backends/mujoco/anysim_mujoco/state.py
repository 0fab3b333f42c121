"""Reads of the neutral state from the batch's arrays."""

from typing import Any

import mujoco
import numpy as np

from anysim_mujoco.layout import Layout, as_slice
from anysim.conventions import Array

_FATAL = [
    int(kind)
    for kind in (
        mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL, mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC,
    )
]  # fmt: skip
"""Warnings after which an env's state means nothing: it diverged, or contacts were dropped for want of memory."""


class StateReader:
    """What the last substep left behind, per env.

    Positions and velocities are those of the state rows. Frames and twists follow from them by a forward pass over the
    envs that were written to since (`touch`). Efforts and contact forces belong to the last substep: writing a state
    does not change them, a reset makes them zero, a restored snapshot brings its own; `held` keeps those.
    """

    def __init__(self, batch: Any, layout: Layout) -> None:
        self._batch, self._layout = batch, layout
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._xpos, self._xquat = batch.bind("xpos"), batch.bind("xquat")
        self._cvel, self._subtree_com = batch.bind("cvel"), batch.bind("subtree_com")
        self._effort, self._sensordata = batch.bind("qfrc_actuator"), batch.bind("sensordata")
        self._bodies, self._roots = as_slice(layout.bodies), layout.roots
        self._joint_q, self._joint_v = as_slice(layout.joint_q), as_slice(layout.joint_v)
        n = batch.nsim
        self._stale = np.zeros(n, dtype=bool)
        self._any_stale = False
        self._held = np.zeros(n, dtype=bool)
        self._any_held = False
        self._held_effort = np.zeros((n, len(layout.joint_v)))
        self._held_contact = np.zeros((n, len(layout.sensors), 3))
        self.failed = np.zeros(n, dtype=bool)
        """Envs that MuJoCo gave up on with an error."""

    def touch(self, ids: Array) -> None:
        """The state of these envs was written; their efforts and contact forces stay those of the last substep."""
        self.hold(ids, self.joint_effort()[ids], self.contact_force()[ids])
        self._stale[ids] = self._any_stale = True

    def hold(self, ids: Array, effort: Array | float, contact: Array | float) -> None:
        """Make these the efforts and contact forces of the last substep."""
        self._held[ids] = self._any_held = True
        self._held_effort[ids], self._held_contact[ids] = effort, contact
        self._stale[ids] = self._any_stale = True

    def stepped(self, ids: Array | None) -> None:
        """These envs were stepped; everything of theirs is new."""
        if self._any_stale or self._any_held:
            which = slice(None) if ids is None else ids
            self._stale[which] = self._held[which] = False
            self._any_stale, self._any_held = bool(self._stale.any()), bool(self._held.any())

    def clear_faults(self, ids: Array) -> None:
        """A reset forgives."""
        self.failed[ids] = False
        self._batch.warning[ids] = 0

    def _forward(self) -> None:
        if self._any_stale:
            # the velocity stage solves no constraints and so leaves the warm start as it is
            self._batch.forward(np.flatnonzero(self._stale), stage=mujoco.mjtStage.mjSTAGE_VEL)
            self._stale[:] = self._any_stale = False

    def read(self, name: str) -> Array:
        """A fresh array of one of the neutral fields."""
        return getattr(self, name)()

    def body_pose(self) -> Array:
        self._forward()
        position, quaternion = self._xpos[:, self._bodies], self._xquat[:, self._bodies]
        pose = np.empty((*position.shape[:2], 7))
        pose[..., :3] = position
        pose[..., 3:6] = quaternion[..., 1:]
        pose[..., 6] = quaternion[..., 0]
        return pose

    def body_twist(self) -> Array:
        self._forward()
        velocity = self._cvel[:, self._bodies]  # angular, then linear at the centre of mass of the whole tree
        twist = np.empty(velocity.shape)
        twist[..., :3] = velocity[..., 3:]
        twist[..., 3:] = velocity[..., :3]
        arm = self._xpos[:, self._bodies] - self._subtree_com[:, self._roots]
        x, y, z = arm[..., 0], arm[..., 1], arm[..., 2]
        wx, wy, wz = velocity[..., 0], velocity[..., 1], velocity[..., 2]
        twist[..., 0] += wy * z - wz * y
        twist[..., 1] += wz * x - wx * z
        twist[..., 2] += wx * y - wy * x
        return twist

    def joint_pos(self) -> Array:
        return np.array(self._qpos[:, self._joint_q])

    def joint_vel(self) -> Array:
        return np.array(self._qvel[:, self._joint_v])

    def joint_effort(self) -> Array:
        effort = np.array(self._effort[:, self._joint_v])
        if self._any_held:
            effort[self._held] = self._held_effort[self._held]
        return effort

    def contact_force(self) -> Array:
        force = np.zeros((len(self._qpos), len(self._layout.sensors), 3))
        for index, addresses in enumerate(self._layout.sensors):
            for address in addresses:
                # MuJoCo reports what the body does to the others
                force[:, index] -= self._sensordata[:, address]
        if self._any_held:
            force[self._held] = self._held_contact[self._held]
        return force

    def fault(self) -> Array:
        finite = np.isfinite(self._qpos).all(axis=1) & np.isfinite(self._qvel).all(axis=1)
        return ~finite | self.failed | (self._batch.warning[:, _FATAL, 1] > 0).any(axis=1)
