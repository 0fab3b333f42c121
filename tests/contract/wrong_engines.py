"""Engines that are wrong in one way each, to prove that the contract suite finds it. `caught_by` names the tests."""

import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from anysim.conventions import wxyz_from_xyzw, xyzw_from_wxyz
from anysim.engine.capability import Capabilities, Capability, Support
from anysim.engine.commands import Control
from anysim.engine.null import NullEngine
from anysim.engine.state import RayHits
from anysim.errors import AnysimError
from anysim.math import pose as P


def _also(*capabilities: Capability) -> Capabilities:
    """What the null engine declares, and more."""
    return Capabilities({**NullEngine.capabilities.supported, **{c: Support() for c in capabilities}})


class Right(NullEngine):
    """Nothing is wrong with it: the null engine, and wrenches that push free bodies of even inertia."""

    capabilities = _also(Capability.WRENCHES)
    caught_by: ClassVar[tuple[str, ...]] = ()

    def _build(self, world, num_envs):
        super()._build(world, num_envs)
        self._wrench = None
        self._mass = np.array([b.inertial.mass for b in world.bodies])[:, None]
        self._moment = np.array([b.inertial.inertia[0] for b in world.bodies])[:, None]

    def _apply_wrench(self, wrench):
        self._wrench = None if wrench is None else wrench.copy()

    def _step(self, n_steps, ids):
        rows = self._all if ids is None else ids
        for _ in range(n_steps):
            if self._wrench is not None:
                push = self._wrench[rows] * self.world.physics.dt
                self._twists[rows, :, :3] += push[..., :3] / self._mass
                self._twists[rows, :, 3:] += push[..., 3:] / self._moment
            super()._step(1, ids)


class Aliasing(Right):
    """Hands its own buffers out as state."""

    caught_by = ("test_aliasing.py::test_state_arrays_never_change_later", "test_aliasing.py::test_states_do_not_share_memory")

    def _read(self, name):
        return self._position[:] if name == "joint_pos" else super()._read(name)


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


class ResetsAll(Right):
    """A partial reset silently resets the other envs as well."""

    caught_by = ("test_stepping.py::test_partial_reset_leaves_the_others",)

    def _reset(self, ids):
        super()._reset(self._all)


class ResetLeavesVelocities(Right):
    """A reset brings positions home and leaves velocities as they are."""

    caught_by = ("test_lifecycle.py::test_reset_leaves_nothing_over",)

    def _reset(self, ids):
        twists, velocity = self._twists[ids], self._velocity[ids]
        super()._reset(ids)
        self._twists[ids], self._velocity[ids] = twists, velocity


class StandsStill(Right):
    """Reports success at every step and moves nothing."""

    caught_by = ("test_stepping.py::test_a_step_moves_what_moves", "test_commands.py::test_position_drive_reaches_its_target")

    def _step(self, n_steps, ids):
        return


class OneStepForAll(Right):
    """Takes one step, however many were asked for."""

    caught_by = ("test_stepping.py::test_many_steps_are_single_steps",)

    def _step(self, n_steps, ids):
        super()._step(1, ids)


class PartialStepMovesAll(Right):
    """A step of some envs moves the others, too."""

    caught_by = ("test_stepping.py::test_partial_step_leaves_the_others",)

    def _step(self, n_steps, ids):
        super()._step(n_steps, None)


class ForgetsCommands(Right):
    """After each step call the drives hold where they are."""

    caught_by = ("test_commands.py::test_commands_persist",)

    def _step(self, n_steps, ids):
        super()._step(n_steps, ids)
        here = self._position[:, self._driven]
        self._control = Control(here, np.zeros_like(here), np.zeros_like(here), np.zeros(here.shape, dtype=np.int8))


class WrenchesStay(Right):
    """A wrench acts until another one comes."""

    caught_by = ("test_commands.py::test_a_wrench_lasts_one_call",)

    def _apply_wrench(self, wrench):
        if wrench is not None:
            super()._apply_wrench(wrench)


class SnapshotForgetsVelocities(Right):
    """Snapshots hold positions only."""

    caught_by = ("test_snapshots.py::test_continuing_is_exact", "test_snapshots.py::test_a_snapshot_brings_the_state_back")

    def _restore(self, ids, data, level):
        super()._restore(ids, {k: np.zeros_like(v) if k in ("twists", "velocity") else v for k, v in data.items()}, level)


class SnapshotForgetsCommands(Right):
    """Restoring leaves the drives' present commands."""

    caught_by = ("test_snapshots.py::test_continuing_is_exact",)

    def restore(self, snapshot, env_ids=None):
        commands = Control(*(part.copy() for part in self._commands.control))
        super().restore(snapshot, env_ids)
        for ours, kept in zip(self._commands.control, commands, strict=True):
            ours[...] = kept


class SnapshotForgetsParameters(Right):
    """Snapshots leave changed parameters out."""

    caught_by = ("test_snapshots.py::test_changed_parameters_travel",)

    def snapshot(self, env_ids=None, level="trajectory"):
        taken = super().snapshot(env_ids, level)
        return replace(taken, data={k: v for k, v in taken.data.items() if not k.startswith("parameter.")})


class TakesAnySnapshot(Right):
    """Accepts snapshots of other worlds when their shapes fit."""

    caught_by = ("test_snapshots.py::test_a_snapshot_of_another_world_is_refused", "test_snapshots.py::test_foreign_snapshots_are_refused")

    def restore(self, snapshot, env_ids=None):
        super().restore(replace(snapshot, world_hash=self.world.hash), env_ids)


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
            turn = self._roots[np.ix_(ids, bodies)][..., 3:]
            world = np.concatenate([P.rotate(turn, twist[..., :3]), P.rotate(turn, twist[..., 3:])], axis=-1)
            super()._write_bodies(ids, bodies, None, world)

    def _read(self, name):
        values = super()._read(name)
        if name == "body_twist":
            turn = super()._read("body_pose")[..., 3:]
            values = np.concatenate([P.rotate_inverse(turn, values[..., :3]), P.rotate_inverse(turn, values[..., 3:])], -1)
        return values


class OwnJointOrder(Right):
    """Has the joints in another order, reading and writing alike."""

    caught_by = ("test_conventions.py::test_links_are_where_kinematics_puts_them", "test_lifecycle.py::test_create_world_begins_in_the_initial_state")

    def _read(self, name):
        values = super()._read(name)
        return np.ascontiguousarray(values[:, ::-1]) if name in ("joint_pos", "joint_vel") else values

    def _write_joints(self, ids, joints, position, velocity):
        super()._write_joints(ids, len(self.world.joints) - 1 - joints, position, velocity)


class ParametersOfAll(Right):
    """Writes a parameter into every env."""

    caught_by = ("test_parameters.py::test_parameters_are_per_env",)

    def _set_parameter(self, name, values, ids, indices):
        super()._set_parameter(name, np.repeat(values[:1], self.num_envs, axis=0), self._all, indices)


class ParametersForgottenAtReset(Right):
    """A reset brings parameters back to the World's."""

    caught_by = ("test_parameters.py::test_parameters_survive_a_reset",)

    def _reset(self, ids):
        super()._reset(ids)
        for name, values in self._values.items():
            values[ids] = self._defaults[name]


class ClaimsRays(Right):
    """Declares ray casts and has none."""

    capabilities = _also(Capability.RAYCAST)
    caught_by = ("test_errors.py::test_declared_is_done_and_undeclared_is_refused",)


class BlindRays(Right):
    """Declares ray casts that never hit."""

    capabilities = _also(Capability.RAYCAST)
    caught_by = ("test_sensing.py::test_rays_hit_at_their_distance",)

    def _raycast(self, origins, directions, ids):
        return RayHits(np.full(origins.shape[:2], np.inf), np.full(origins.shape[:2], -1))


class ClaimsDynamics(Right):
    """Declares dynamics; bodies hang in the air."""

    capabilities = _also(Capability.DYNAMICS)
    caught_by = ("test_stepping.py::test_a_dropped_ball_falls", "test_physics.py::test_free_fall")


class SwallowsMisuse(Right):
    """Does nothing, quietly, where it is misused."""

    caught_by = ("test_errors.py::test_misuse_is_an_error_and_changes_nothing",)

    def set_joint_state(self, *args: Any, **kwargs: Any):
        try:
            super().set_joint_state(*args, **kwargs)
        except AnysimError:
            return


class HalfDone(Right):
    """Writes before it checks: a refused call has changed something."""

    caught_by = ("test_parameters.py::test_bounds_are_kept",)

    def set_parameters(self, name, values, env_ids=None, indices=None):
        self._values[name][0, 0] = np.asarray(values, dtype=float).reshape(-1)[0]
        super().set_parameters(name, values, env_ids, indices)


class DependsOnNumber(Right):
    """Rounds otherwise when there are more envs."""

    caught_by = ("test_stepping.py::test_envs_do_not_depend_on_their_number",)

    def _step(self, n_steps, ids):
        super()._step(n_steps, ids)
        self._position *= 1.0 + 1e-15 * self.num_envs


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
            self._roots = data["roots"]


class DestroysOnce(Right):
    """A second destroy() fails."""

    caught_by = ("test_lifecycle.py::test_destroy_is_idempotent",)

    def destroy(self):
        if self._destroyed:
            raise RuntimeError("destroyed twice")
        super().destroy()


class SinglePrecision(Right):
    """Returns float32."""

    caught_by = ("test_conventions.py::test_shapes_and_types",)

    def _read(self, name):
        values = super()._read(name)
        return values if values.dtype == bool else values.astype(np.float32)


class SharedCommands(Right):
    """Keeps the commands of all engines in one place."""

    caught_by = ("test_lifecycle.py::test_two_engines_do_not_meet",)
    _shared: ClassVar[dict[tuple[int, ...], Control]] = {}

    def _apply_control(self, control):
        super()._apply_control(control)
        self._shared[control.position.shape] = self._control

    def _step(self, n_steps, ids):
        self._control = self._shared[self._control.position.shape]
        super()._step(n_steps, ids)


class Races(Right):
    """Has no lock."""

    caught_by = ("test_threads.py::test_steps_from_threads_add_up",)

    def __init__(self, **options: Any):
        super().__init__(**options)
        self._lock = nullcontext()  # type: ignore[assignment]

    def _step(self, n_steps, ids):
        before = self._roots.copy()
        time.sleep(1e-4)  # lets another thread in
        self._roots = before
        super()._step(n_steps, ids)


class LeaksHandles(Right):
    """Every world leaves an open file."""

    caught_by = ("test_leaks.py::test_no_memory_threads_or_handles_are_left",)
    _open: ClassVar[list[Any]] = []

    def _build(self, world, num_envs):
        super()._build(world, num_envs)
        self._open.append(Path(__file__).open())


class LeaksMemory(Right):
    """Every world leaves two megabytes."""

    caught_by = ("test_leaks.py::test_no_memory_threads_or_handles_are_left",)
    _kept: ClassVar[list[Any]] = []

    def _build(self, world, num_envs):
        super()._build(world, num_envs)
        self._kept.append(np.ones(2**18))


class ForgetsOnEdit(Right):
    """Begins anew when something is added or removed."""

    caught_by = ("test_editing.py::test_adding_leaves_the_others", "test_editing.py::test_removing_leaves_the_others")

    def _rebuild(self, world):
        super()._rebuild(world)
        self.reset()


class MimicsStayBehind(Right):
    """Mimic joints do not follow."""

    caught_by = ("test_commands.py::test_mimic_joints_follow",)

    def _build(self, world, num_envs):
        super()._build(world, num_envs)
        self._followers = []
