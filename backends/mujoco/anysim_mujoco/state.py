"""Reads of the neutral state from the batch's arrays."""

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, NamedTuple

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.engine.state import FIELDS
from anysim_mujoco.layout import Layout, as_slice

_FATAL = [
    int(kind)
    for kind in (
        mujoco.mjtWarning.mjWARN_CONTACTFULL,
        mujoco.mjtWarning.mjWARN_CNSTRFULL,
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
]
"""Warnings after which an env's state means nothing: it diverged, or contacts were dropped for want of memory."""


class _TwistColumns(NamedTuple):
    """Columns (6, B) of cvel and of xpos and subtree_com, each flattened to one row per env, that make up the twist.

    The cross product w x r is (wy rz, wz rx, wx ry) - (wz ry, wx rz, wy rx): `first` holds the factors of w in this
    order, `second` those of r. Bodies come last, so that numpy's inner loops run over them and not over three numbers.
    """

    linear_angular: Array
    first: Array
    second: Array
    second_root: Array
    by_body: Array

    @classmethod
    def of(cls, layout: Layout) -> "_TwistColumns":
        factors, count = np.array([2, 0, 1, 1, 2, 0])[:, None], len(layout.bodies)
        return cls(
            6 * layout.bodies + np.array([3, 4, 5, 0, 1, 2])[:, None],
            6 * layout.bodies + np.array([1, 2, 0, 2, 0, 1])[:, None],
            3 * layout.bodies + factors,
            3 * layout.roots + factors,
            np.arange(6 * count).reshape(6, count).T.copy(),
        )


def _columns(array: Array, at: Array) -> Callable[[], Array]:
    """Copies columns of a live array; of a view made once where they are consecutive, which costs one call."""
    chosen = as_slice(at)
    return array[:, chosen].copy if isinstance(chosen, slice) else lambda: array[:, at]


class StateReader:
    """What the last substep left behind, per env.

    Positions and velocities are those of the state rows. Frames and twists follow from them by a forward pass over the
    envs that were written to since (`touch`). Efforts and contact forces belong to the last substep: writing a state
    does not change them, a reset makes them zero, a restored snapshot brings its own; `held` keeps those.
    """

    def __init__(self, batch: Any, layout: Layout) -> None:
        self._batch, self._layout = batch, layout
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._frames, self._bodies = (batch.bind("xpos"), batch.bind("xquat")), as_slice(layout.bodies)
        self._pose_parts = self._parts() if isinstance(self._bodies, slice) else None  # views, which stay true
        n = batch.nsim
        self._velocity, self._position, self._center = (
            batch.bind(name).reshape(n, -1) for name in ("cvel", "xpos", "subtree_com")
        )
        self._take = _TwistColumns.of(layout)
        self._sensordata = batch.bind("sensordata")
        self._contact_at = np.concatenate([np.zeros(0, dtype=np.intp), *(at.reshape(-1) for at in layout.sensors)])
        """(K,) places in `sensordata` of all that adds up to contact sensors."""
        axes = [3 * index + np.tile(np.arange(3), len(at)) for index, at in enumerate(layout.sensors)]
        into = np.concatenate([np.zeros(0, dtype=np.intp), *axes])
        self._contact_into = (3 * len(layout.sensors) * np.arange(n)[:, None] + into).reshape(-1)
        """(n K,) where it goes in a flat array of their forces."""
        self._warnings = batch.warning[:, :, 1]
        self.joint_pos = _columns(self._qpos, layout.joint_q)
        self.joint_vel = _columns(self._qvel, layout.joint_v)
        self._effort = _columns(batch.bind("qfrc_actuator"), layout.joint_v)
        self._stale = np.zeros(n, dtype=bool)
        self._any_stale = False
        self._held = np.zeros(n, dtype=bool)
        self._any_held = False
        self._held_effort = np.zeros((n, len(layout.joint_v)))
        self._held_contact = np.zeros((n, len(layout.sensors), 3))
        self.fields: Mapping[str, Callable[[], Array]] = {name: getattr(self, name) for name in FIELDS}
        """Reads a fresh array of one of the neutral fields."""
        self.failed = np.zeros(n, dtype=bool)
        """Envs that MuJoCo gave up on with an error."""

    def touch(self, ids: Array) -> None:
        """The state of these envs was written; their efforts and contact forces stay those of the last substep."""
        fresh = ids[~self._held[ids]]  # the others are held already
        if len(fresh):
            self.hold(fresh, self.joint_effort()[fresh], self.contact_force()[fresh])
        self._stale[ids] = self._any_stale = True

    def hold(self, ids: Array, effort: Array | float, contact: Array | float) -> None:
        """The state of these envs was written; make these their efforts and contact forces of the last substep."""
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
        # the velocity stage solves no constraints and so leaves the warm start as it is
        self._batch.forward(np.flatnonzero(self._stale), stage=mujoco.mjtStage.mjSTAGE_VEL)
        self._stale[:] = self._any_stale = False

    def body_pose(self) -> Array:
        if self._any_stale:
            self._forward()
        return np.concatenate(self._pose_parts or self._parts(), axis=2)

    def _parts(self) -> tuple[Array, Array, Array]:
        position, quaternion = (array[:, self._bodies] for array in self._frames)
        return position, quaternion[..., 1:], quaternion[..., :1]

    def body_twist(self) -> Array:
        # cvel is the angular velocity, then the linear one of the point at the centre of mass of the whole tree; the
        # frame's differs by the angular velocity x the arm. Six products at once and then their differences: for one
        # env it is the number of calls of numpy that costs
        if self._any_stale:
            self._forward()
        velocity, take = self._velocity, self._take
        twist = velocity.take(take.linear_angular, axis=1)
        arm = self._position.take(take.second, axis=1)
        arm -= self._center.take(take.second_root, axis=1)
        arm *= velocity.take(take.first, axis=1)
        linear = twist[:, :3]
        linear += arm[:, :3]
        linear -= arm[:, 3:]
        return twist.reshape(len(twist), -1).take(take.by_body, axis=1)

    def joint_effort(self) -> Array:
        effort = self._effort()
        if self._any_held:
            effort[self._held] = self._held_effort[self._held]
        return effort

    def contact_force(self) -> Array:
        force = np.zeros((len(self._qpos), len(self._layout.sensors), 3))
        if len(self._contact_at):  # MuJoCo reports what the body does to the others; summed one after another
            np.subtract.at(force.reshape(-1), self._contact_into, self._sensordata[:, self._contact_at].reshape(-1))
        if self._any_held:
            force[self._held] = self._held_contact[self._held]
        return force

    def fault(self) -> Array:
        # a finite sum of squares has finite terms, and is found much faster; else each env is looked at
        finite = isfinite(np.vdot(self._qpos, self._qpos)) and isfinite(np.vdot(self._qvel, self._qvel))
        if finite and not np.count_nonzero(self.failed) and not np.count_nonzero(self._warnings):
            return np.zeros(len(self._qpos), dtype=bool)
        finite = np.isfinite(self._qpos).all(axis=1) & np.isfinite(self._qvel).all(axis=1)
        return ~finite | self.failed | (self._warnings[:, _FATAL] > 0).any(axis=1)
