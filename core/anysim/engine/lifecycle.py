"""Lifecycle of an engine: what it declares, its World from build to destruction, resets, steps and states."""

import threading
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, ClassVar, Self

import numpy as np

from anysim.conventions import Array
from anysim.engine import arguments
from anysim.engine.availability import Finding, LibraryRequirement
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Allowance, Capabilities, Capability, Need, check
from anysim.engine.conditioning import doubts
from anysim.engine.control import CommandBuffer
from anysim.engine.extent import Extent
from anysim.engine.lifetime import EngineLifetime
from anysim.engine.options import EngineOptions
from anysim.engine.presence import Lifecycle, Presence, write_present
from anysim.engine.primitives import Primitives
from anysim.engine.records import EnvRecords, RebuildState
from anysim.engine.requirements import check_drives, check_masses, needs_of
from anysim.engine.reserved_names import check_class, check_instance
from anysim.engine.state import Availability, State
from anysim.errors import CapabilityError, EngineError
from anysim.math.arrays import whole
from anysim.model.index import Index
from anysim.model.world import World

EnvIds = Sequence[int] | Array | None
"""Env indices: None for all, else unique ones."""

Indices = Sequence[int] | Array | None
"""Indices of joints, bodies, actuators and the like: None for all, else unique ones."""


Overlay = Callable[[Array, CameraView, Mapping[str, Array]], None]
"""Draws into images (E, H, W, …) of the envs (E,) by channel, where nearer than their `depth`, and keeps that."""


class EngineLifecycle(EngineLifetime, Primitives):
    """The part of `SimEngine` that builds, steps and frees; see `anysim.engine.base.SimEngine`."""

    name: ClassVar[str]
    capabilities: ClassVar[Capabilities]
    parameters: ClassVar[frozenset[str]] = frozenset()
    """The names of `anysim.engine.parameters` that the engine can change per env."""
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P3
    """What it can do with an entity after the build; all but P3 goes with Capability.VARYING_ENTITIES."""
    parallel: ClassVar[bool] = False
    """Whether it steps its envs on several cores by itself, so that more processes (`shards: auto`) gain nothing."""
    library: ClassVar[LibraryRequirement | None] = None
    """What it is built on; an engine without one overrides `availability`."""
    options_type: ClassVar[type[EngineOptions] | None] = None
    audit_allowances: ClassVar[Mapping[str, Allowance]] = {}
    """By quantity of the audit what the engine declares to be off; all else is taken over to single precision."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Raises EngineError where a class takes a name that belongs to the base classes."""
        super().__init_subclass__(**keywords)
        check_class(cls)

    def __init__(self, **options: Any) -> None:
        """Options are those of `options_model`; a wrong one raises EngineError with what exists."""
        self.options = arguments.validated_options(self.name, self.options_model(), options)
        self._lock = threading.RLock()
        self._world: World | None = None
        self._built = self._destroyed = False
        self.overlays: list[Overlay] = []
        """What is drawn over the engine's images, in order: matter that it does not hold."""

    # ------------------------------------------------------------------ what it is

    @classmethod
    def availability(cls) -> Availability:
        """Whether it can run here, by the installed version of its library. Imports nothing heavy and never raises."""
        unnamed = Availability(False, missing=(f"{cls.name} names no library",))
        return unnamed if cls.library is None else cls.library.availability()

    @classmethod
    def options_model(cls) -> Any:
        """The pydantic model of the engine's options, or None if it has none: the type of its attribute `options`."""
        return cls.options_type

    @classmethod
    def findings(cls) -> Sequence[Finding]:
        """What else `anysim doctor` should say of the engine on this machine: threads, drivers, versions to avoid."""
        return ()

    @classmethod
    def share_of_threads(cls, options: Mapping[str, Any], threads: int) -> dict[str, Any]:
        """The options of one of several processes that share the machine, each to use about that many threads.

        What the user chose stays. They must not change results.
        """
        del threads
        return dict(options)

    @classmethod
    def refusals(cls, world: World, options: object) -> Sequence[str]:
        """Why this world in particular cannot be built, beyond capabilities: a reason each. Imports nothing heavy.

        `options` are those that the engine will have, of type `options_model`; None of an engine without any.
        """
        return ()

    @property
    def version(self) -> str:
        """The version of the physics engine, with the options that shape trajectories where they are not the defaults.

        It stamps snapshots.
        """
        stamp = self.options.trajectory_stamp() if isinstance(self.options, EngineOptions) else ""
        version = self.availability().version
        return f"{version} ({stamp})" if stamp else version

    @property
    def world(self) -> World:
        """The World it runs."""
        self._require_world()
        assert self._world is not None
        return self._world

    @property
    def lock(self) -> AbstractContextManager[object]:
        """The lock of every public method; hold it to read several fields of one moment beside other threads."""
        return self._lock

    # ------------------------------------------------------------------ building

    def create_world(self, world: World, num_envs: int = 1) -> Self:
        """Build `num_envs` copies of a World and reset them all.

        Raises:
            CapabilityError: the world needs what the engine does not have; nothing was built.
            EngineError: there is a world already, or the engine was destroyed.
        """
        with self._lock:
            if self._destroyed:
                raise EngineError(f"this {self.name} engine {self._ended}")
            if self._world is not None:
                raise EngineError(f"this {self.name} engine has a world already; destroy() it or make another engine")
            if num_envs < 1:
                raise EngineError(f"num_envs must be at least 1, got {num_envs}")
            self.approximations: list[Need] = self._check(world)
            check_masses(world)
            check_drives(world)
            for doubt in doubts(world):
                warnings.warn(str(doubt), doubt.category, stacklevel=2)
            self._install(world, num_envs)
            try:
                self._build_envs()
            except BaseException:
                self._clear()
                raise
            self._reset_rows(self._all)
            return self

    def _host(self, world: World, num_envs: int) -> None:
        """Build envs of which another engine, in another process, checks arguments and keeps presence and commands."""
        self._install(world, num_envs)
        try:
            self._build(world, num_envs)
        except BaseException:
            self._world = None
            raise
        self._built = True

    def _check(self, world: World) -> list[Need]:
        return check(
            self.name, self.capabilities, needs_of(world), f"'{world.name}'", self.refusals(world, self.options)
        )

    def _install(self, world: World, num_envs: int) -> None:
        """Everything the base class keeps about a world."""
        self._world = world
        self._dt = world.physics.dt
        self.num_envs = num_envs
        self.index = Index(world)
        self._all = np.arange(num_envs)
        self._state: State | None = None
        self._records = EnvRecords(world, num_envs)
        self._row_forms: dict[str, Mapping[str, Array]] = {}
        self._extent = Extent(world)

    def _build_envs(self) -> None:
        kept = {**vars(self), "_built": True}
        self._build(self.world, self.num_envs)
        self._built = True
        check_instance(self, kept)
        if self._presence.varies:
            self._populate(self._all)

    def _release(self) -> None:
        """Free what was built; a build that failed has left nothing."""
        if self._built:
            self._built = False
            self._free()

    def _clear(self) -> None:
        """Free the world, if there is one."""
        if self._world is not None:
            self._retire_state()
            self._release()
            self._world = None

    def _rebuild(self, world: World) -> None:
        """Replace the world, carrying by name all that both worlds have. On failure the old one is built again."""
        needs, state = self._check(world), self.get_state()
        changed = {name: np.array(self._get_parameter(name)) for name in self._records.changed}
        kept = RebuildState.of(self.world, state, self._records, changed, self._carry_rows())
        try:
            self._build_from(world, kept)
        except BaseException:
            self._build_from(kept.world, kept)
            raise
        self.approximations = needs

    def _build_from(self, world: World, kept: RebuildState) -> None:
        self._retire_state()
        self._release()
        self._install(world, self.num_envs)
        self._presence.carry(kept.records.presence)
        self._build_envs()
        self._reset_rows(self._all)
        for name, which, values in kept.parameters(world):
            self._set_parameter(name, values, self._all, which)
            self._records.changed[name] = None
        for which, poses, twists in kept.bodies(world):
            write_present(self._write_bodies, self._presence.bodies, self._all, which, poses, twists)
        which, positions, velocities = kept.joints(world)
        if len(which):
            write_present(self._write_joints, self._presence.joints, self._all, which, positions, velocities)
        self._records.carry(kept.records)
        self._take_rows(kept.solver, kept.world)

    def destroy(self) -> None:
        """Free the world. May be called any number of times."""
        with self._lock:
            self._clear()
            self._destroyed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.destroy()

    # ------------------------------------------------------------------ resets and presence

    def reset(self, env_ids: EnvIds = None, present: Any = None) -> None:
        """Put envs into the World's initial state; commands return to holding it. Parameters stay as they are.

        Args:
            env_ids: which envs.
            present: (E, entities) bool, what is there from now on; None leaves it as it is. What is in no slot of the
                World is always there, and of each slot at most one entity.

        Raises:
            CapabilityError: what is there was to change, and the engine cannot change it.
            EngineError: rows that no env can have; nothing was changed.
        """
        with self._lock:
            self._require_world()
            ids = self._ids(env_ids)
            if present is not None:
                self._admit(ids, self._presence.checked(present, ids))
            self._reset_rows(ids)

    def _admit(self, ids: Array, present: Array) -> Array:
        """Change what is there; returns the envs where that is another than before, which then need a reset."""
        changed = self._presence.changed(ids, present)
        if len(changed):
            self._require(Capability.VARYING_ENTITIES)
            self._retire_state()
            before = self._presence.entities[ids]
            self._records.appearance[changed] += 1
            self._presence.write(ids, present)
            try:
                self._populate(changed)
            except BaseException:
                self._presence.write(ids, before)
                self._populate(changed)  # of several envs or workers some may have gone on to the new one
                raise
        return changed

    @property
    def presence(self) -> Array:
        """(N, entities) bool: which of the World's entities are there. Bodies of the others read as the world's frame.

        What is written to them has no effect but for parameters, which wait for them.
        """
        with self._lock:
            self._require_world()
            return self._presence.entities.copy()

    def _reset_rows(self, ids: Array) -> None:
        self._retire_state()
        self._records.reset(ids)
        self._reset(ids)

    # ------------------------------------------------------------------ stepping and reading

    def step(self, n_steps: int = 1, env_ids: EnvIds = None, *, keep_wrench: bool = False) -> None:
        """Advance by `n_steps` physics steps of `world.physics.dt`; with `env_ids`, only those envs.

        Commands persist; a wrench lasts for the next call that steps its env, and with `keep_wrench` for the one after
        it too, where a control step is made in parts. A non-finite env is marked in `State.fault`, the others go on.
        """
        with self._lock:
            self._require_world()
            if n_steps.__class__ is not int or not 1 <= n_steps < 2**31:
                n_steps = whole("n_steps", n_steps, EngineError, 1, 2**31)
            ids = None if env_ids is None else self._ids(env_ids)
            self._retire_state()
            records, commands = self._records, self._records.commands
            if commands.control_changed:
                self._apply_control(commands.control)
                commands.control_changed = False
            if (acting := commands.acting) is not None:
                self._apply_wrench(acting)
            self._step(n_steps, ids)
            if acting is not None and (not keep_wrench or commands.once is not None):
                if keep_wrench:
                    commands.once = None
                else:
                    commands.spend_wrench(ids)
                self._apply_wrench(None)  # what waits for others comes with their step, unless a reset forgets it
            if ids is None:
                records.ticks += n_steps
            else:
                records.ticks[ids] += n_steps

    def get_state(self) -> State:
        """The state of all envs now: read lazily, cached until the engine moves on."""
        if (state := self._state) is not None:  # one reference, read at once: nothing to lock
            return state
        with self._lock:
            if self._state is None:
                self._require_world()
                self._state = State(self._read_locked, self._records.ticks * self._dt)
            return self._state

    def _read_locked(self, name: str) -> Array:
        with self._lock:
            array, presence = self._read(name), self._records.presence
            if presence.varies:
                presence.blank(name, array)
            if name == "fault" and self._extent.watched and self._state is not None:
                array = self._extent.with_those_outside(array, self._state.body_pose)
            return array

    def fault_reason(self, env: int) -> str:
        """Why an env is faulted now, in a sentence that names the body, where it is and when; empty if it is not."""
        state = self.get_state()
        if not state.fault[env]:
            return ""
        return self._extent.reason(state.body_pose[env], float(state.time[env])) or (
            f"the state of env {env} is not finite, or {self.name} gave up on it, at {state.time[env]:.3f} s"
        )

    def _retire_state(self) -> None:
        if self._state is not None:
            self._state.retire()
            self._state = None

    # ------------------------------------------------------------------ helpers

    @property
    def _commands(self) -> CommandBuffer:
        return self._records.commands

    @property
    def _presence(self) -> Presence:
        return self._records.presence

    def _require_world(self) -> None:
        if self._world is None:
            state = self._ended if self._destroyed else "has no world; call create_world() first"
            raise EngineError(f"this {self.name} engine {state}")

    def _require(self, capability: Capability) -> None:
        if capability not in self.capabilities:
            raise CapabilityError(
                f"{self.name} does not have '{capability}' (`anysim list engines` shows what each can do)"
            )

    def _ids(self, env_ids: EnvIds) -> Array:
        return self._all if env_ids is None else arguments.indices(env_ids, self.num_envs, "env")

    def _which(self, indices: Indices, size: int, kind: str) -> Array:
        return np.arange(size) if indices is None else arguments.indices(indices, size, kind)
