"""Engines that are wrong in one way each, to prove that the contract suite finds it. `caught_by` names the tests."""

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from right_engine import Right

from anysim.engine.control import Control
from anysim.errors import AnysimError


class ResetsAll(Right):
    """A partial reset silently resets the other envs as well."""

    caught_by = ("test_stepping.py::test_partial_reset_leaves_the_others",)

    def _reset(self, ids):
        super()._reset(self._all)


class ResetLeavesVelocities(Right):
    """A reset brings positions home and leaves velocities as they are."""

    caught_by = ("test_lifecycle.py::test_reset_leaves_nothing_over",)

    def _reset(self, ids):
        twists, velocity = self._envs.twists[ids], self._envs.velocity[ids]
        super()._reset(ids)
        self._envs.twists[ids], self._envs.velocity[ids] = twists, velocity


class StandsStill(Right):
    """Reports success at every step and moves nothing."""

    caught_by = (
        "test_stepping.py::test_a_step_moves_what_moves",
        "test_commands.py::test_position_drive_reaches_its_target",
    )

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
        here = self._envs.position[:, self._envs.driven]
        self._envs.control = Control(
            here, np.zeros_like(here), np.zeros_like(here), np.zeros(here.shape, dtype=np.int8)
        )


class WrenchesStay(Right):
    """A wrench acts until another one comes."""

    caught_by = ("test_commands.py::test_a_wrench_lasts_one_call",)

    def _apply_wrench(self, wrench):
        if wrench is not None:
            super()._apply_wrench(wrench)


class SnapshotForgetsVelocities(Right):
    """Snapshots hold positions only."""

    caught_by = (
        "test_snapshots.py::test_continuing_is_exact",
        "test_snapshots.py::test_a_snapshot_brings_the_state_back",
    )

    def _restore(self, ids, data, level):
        super()._restore(
            ids, {k: np.zeros_like(v) if k in ("twists", "velocity") else v for k, v in data.items()}, level
        )


class SnapshotForgetsCommands(Right):
    """Restoring leaves the drives' present commands."""

    caught_by = ("test_snapshots.py::test_continuing_is_exact",)

    def restore(self, snapshot, env_ids=None, *, checked=False):
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

    caught_by = (
        "test_snapshots.py::test_a_snapshot_of_another_world_is_refused",
        "test_snapshots.py::test_foreign_snapshots_are_refused",
    )

    def restore(self, snapshot, env_ids=None, *, checked=False):
        super().restore(replace(snapshot, world_hash=self.world.hash), env_ids)


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
        for name, values in self._envs.table.values.items():
            values[ids] = self._envs.table.default(name)


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
        self._envs.table.values[name][0, 0] = np.asarray(values, dtype=float).reshape(-1)[0]
        super().set_parameters(name, values, env_ids, indices)


class DependsOnNumber(Right):
    """Rounds otherwise when there are more envs."""

    caught_by = ("test_stepping.py::test_envs_do_not_depend_on_their_number",)

    def _step(self, n_steps, ids):
        super()._step(n_steps, ids)
        self._envs.position *= 1.0 + 1e-15 * self.num_envs


class DestroysOnce(Right):
    """A second destroy() fails."""

    caught_by = ("test_lifecycle.py::test_destroy_is_idempotent",)

    def destroy(self):
        if self._destroyed:
            raise RuntimeError("destroyed twice")
        super().destroy()


class SharedCommands(Right):
    """Keeps the commands of all engines in one place."""

    caught_by = ("test_lifecycle.py::test_two_engines_do_not_meet",)
    _shared: ClassVar[dict[tuple[int, ...], Control]] = {}

    def _apply_control(self, control):
        self._shared[control.position.shape] = Control(*(part.copy() for part in control))

    def _step(self, n_steps, ids):
        self._envs.control = self._shared[self._commands.control.position.shape]
        super()._step(n_steps, ids)


class Races(Right):
    """Lets another thread in while it steps."""

    caught_by = ("test_threads.py::test_steps_from_threads_add_up",)

    def _step(self, n_steps, ids):
        before = self._envs.roots.copy()
        self._lock.release()
        time.sleep(1e-4)
        self._lock.acquire()
        self._envs.roots = before
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

    def _take_rows(self, carried, old):
        self.reset()


class DependsOnProcess(Right):
    """Rounds by something that differs between processes."""

    caught_by = ("test_stepping.py::test_the_same_run_in_another_process",)

    def _step(self, n_steps, ids):
        super()._step(n_steps, ids)
        self._envs.twists *= 1.0 + 1e-12 * os.getpid()


class MovesOnRefusal(Right):
    """Takes the world apart before it knows whether the new one can be built."""

    caught_by = ("test_editing.py::test_a_wrong_edit_changes_nothing",)

    def add_object(self, name, source, **spec):
        self.reset()
        super().add_object(name, source, **spec)
