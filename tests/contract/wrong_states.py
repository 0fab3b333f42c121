"""Engines whose states mean something else, or are not the caller's own. `caught_by` names the tests that find it."""

from dataclasses import replace

import numpy as np
from right_engine import Right, also

from anysim.conventions import wxyz_from_xyzw, xyzw_from_wxyz
from anysim.engine.capability import Capability
from anysim.engine.presence import Lifecycle
from anysim.engine.state import RayHits
from anysim.errors import EngineError
from anysim.math import pose as P


class Aliasing(Right):
    """Hands its own buffers out as state."""

    caught_by = (
        "test_aliasing.py::test_state_arrays_never_change_later",
        "test_aliasing.py::test_states_do_not_share_memory",
    )

    def _read(self, name):
        return self._envs.position[:] if name == "joint_pos" else super()._read(name)


class ScalarFirst(Right):
    """Reads and writes quaternions as wxyz: what is written is read back, and means another rotation."""

    caught_by = ("test_conventions.py::test_quaternions_are_xyzw",)

    def _read(self, name):
        values = super()._read(name)
        if name == "body_pose":
            values[..., 3:] = wxyz_from_xyzw(values[..., 3:])
        return values

    def _write_bodies(self, ids, bodies, pose, twist):
        if pose is not None:
            pose = np.concatenate([pose[..., :3], xyzw_from_wxyz(pose[..., 3:])], axis=-1)
        super()._write_bodies(ids, bodies, pose, twist)


class CentreOfMassVelocity(Right):
    """Reads and writes the velocity of the centre of mass: read back it looks right, but the origin moves otherwise."""

    caught_by = ("test_conventions.py::test_linear_velocity_is_that_of_the_frame_origin",)

    def _offset(self):
        com = np.array([b.inertial.com for b in self.world.bodies])
        return P.rotate(super()._read("body_pose")[..., 3:], np.broadcast_to(com, (self.num_envs, len(com), 3)))

    def _read(self, name):
        values = super()._read(name)
        if name == "body_twist":
            values[..., :3] += P.cross(values[..., 3:], self._offset())
        return values

    def _write_bodies(self, ids, bodies, pose, twist):
        super()._write_bodies(ids, bodies, pose, None)
        if twist is not None:
            twist = twist.copy()
            twist[..., :3] -= P.cross(twist[..., 3:], self._offset()[np.ix_(ids, bodies)])
            super()._write_bodies(ids, bodies, None, twist)


class CentreOfMassPose(Right):
    """Reads the pose of the centre of mass, as some engines do."""

    caught_by = ("test_conventions.py::test_poses_are_those_of_frames",)

    def _read(self, name):
        values = super()._read(name)
        if name == "body_pose":
            com = np.array([b.inertial.com for b in self.world.bodies])
            values[..., :3] += P.rotate(values[..., 3:], np.broadcast_to(com, values[..., :3].shape))
        return values


class BodyAxes(Right):
    """Reads and writes twists in body axes."""

    caught_by = ("test_conventions.py::test_angular_velocity_is_in_world_axes",)

    def _write_bodies(self, ids, bodies, pose, twist):
        super()._write_bodies(ids, bodies, pose, None)
        if twist is not None:
            turn = self._envs.roots[np.ix_(ids, bodies)][..., 3:]
            world = np.concatenate([P.rotate(turn, twist[..., :3]), P.rotate(turn, twist[..., 3:])], axis=-1)
            super()._write_bodies(ids, bodies, None, world)

    def _read(self, name):
        values = super()._read(name)
        if name == "body_twist":
            turn = super()._read("body_pose")[..., 3:]
            values = np.concatenate(
                [P.rotate_inverse(turn, values[..., :3]), P.rotate_inverse(turn, values[..., 3:])], -1
            )
        return values


class OwnJointOrder(Right):
    """Has the joints in another order, reading and writing alike."""

    caught_by = (
        "test_conventions.py::test_links_are_where_kinematics_puts_them",
        "test_lifecycle.py::test_create_world_begins_in_the_initial_state",
    )

    def _read(self, name):
        values = super()._read(name)
        return np.ascontiguousarray(values[:, ::-1]) if name in ("joint_pos", "joint_vel") else values

    def _write_joints(self, ids, joints, position, velocity):
        super()._write_joints(ids, len(self.world.joints) - 1 - joints, position, velocity)


class SinglePrecision(Right):
    """Returns float32."""

    caught_by = ("test_conventions.py::test_shapes_and_types",)

    def _read(self, name):
        values = super()._read(name)
        return values if values.dtype == bool else values.astype(np.float32)


class KeepsInputs(Right):
    """Keeps the caller's array and reads it at the next step."""

    caught_by = ("test_aliasing.py::test_inputs_are_not_kept",)
    _pending = None

    def _write_joints(self, ids, joints, position, velocity):
        super()._write_joints(ids, joints, position, velocity)
        self._pending = (ids, joints, position)

    def _step(self, n_steps, ids):
        if self._pending is not None:
            super()._write_joints(*self._pending, None)
        self._pending = None
        super()._step(n_steps, ids)


class SnapshotsAlias(Right):
    """Restores from a snapshot by keeping its arrays."""

    caught_by = ("test_aliasing.py::test_snapshots_are_copies",)

    def _restore(self, ids, data, level):
        super()._restore(ids, data, level)
        if len(ids) == self.num_envs:
            self._envs.roots = data["roots"]


class ReadingDisturbs(Right):
    """Reading the state moves it a little."""

    caught_by = ("test_stepping.py::test_reading_changes_nothing",)

    def _read(self, name):
        self._envs.position += 1e-12
        return super()._read(name)


class MimicsStayBehind(Right):
    """Mimic joints do not follow."""

    caught_by = ("test_commands.py::test_mimic_joints_follow",)

    def _build(self, world, num_envs):
        super()._build(world, num_envs)
        self._envs.followers = []


class BlindRays(Right):
    """Declares ray casts that never hit."""

    capabilities = also(Capability.RAYCAST)
    caught_by = ("test_sensing.py::test_rays_hit_at_their_distance",)

    def _raycast(self, origins, directions, ids):
        return RayHits(np.full(origins.shape[:2], np.inf), np.full(origins.shape[:2], -1))


class ClaimsRays(Right):
    """Declares ray casts and has none."""

    capabilities = also(Capability.RAYCAST)
    caught_by = ("test_errors.py::test_declared_is_done_and_undeclared_is_refused",)


class FliesAway(Right):
    """After some steps a free body is at 1e68 m, in every run alike."""

    caught_by = ("test_stepping.py::test_the_same_run_twice", "test_loose_bodies.py::test_steps_add_up")

    def _read(self, name):
        values = super()._read(name)
        if name == "body_pose" and self._records.ticks.max(initial=0) > 10:
            values[:, -1, 1] = 1e68
        return values


class HidesFaults(Right):
    """An env that is not finite is not marked."""

    caught_by = ("test_loose_bodies.py::test_steps_add_up",)

    def _read(self, name):
        values = super()._read(name)
        if name == "body_twist" and self._records.ticks.max(initial=0) > 10:
            values[:, -1] = np.nan
        return np.zeros_like(values) if name == "fault" else values


class ClaimsPictures(Right):
    """Declares pictures; each attempt to draw one is an error, which is no lack of the machine's."""

    capabilities = also(Capability.RENDER_RGB)
    caught_by = ("test_sensing.py::test_the_default_camera_shows_the_world",)

    def _render(self, view, ids, channels):
        raise EngineError("the canvas is torn; it cannot draw")


class ClaimsDynamics(Right):
    """Declares dynamics; bodies hang in the air."""

    capabilities = also(Capability.DYNAMICS)
    caught_by = ("test_stepping.py::test_a_dropped_ball_falls", "test_physics.py::test_free_fall")


class PresenceOfAll(Right):
    """A change of what is present resets the other envs as well."""

    caught_by = ("test_varying.py::test_other_envs_do_not_notice",)

    def _populate(self, ids):
        self._reset(self._all)


class SnapshotForgetsPresence(Right):
    """Snapshots do not say who was there."""

    caught_by = ("test_varying_snapshots.py::test_rows_of_a_snapshot_go_into_envs_of_another_presence",)

    def snapshot(self, env_ids=None, level="trajectory"):
        taken = super().snapshot(env_ids, level)
        return replace(taken, data={k: v for k, v in taken.data.items() if k != "present"})


class NoLifecycle(Right):
    """Lets entities vary and says that they cannot."""

    lifecycle = Lifecycle.P3
    caught_by = ("test_varying.py::test_the_lifecycle_is_declared",)
