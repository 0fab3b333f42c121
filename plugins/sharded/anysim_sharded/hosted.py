"""Engine of a worker process: the primitives of any engine, for one block of the parent's envs."""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.control import Control
from anysim.engine.parameters import PARAMETERS
from anysim.engine.state import SnapshotLevel
from anysim.model.world import World
from anysim_processes.shared_memory import Layout, SharedArrays


class News(NamedTuple):
    """What changed in the shared memory since the last message to this worker; `wrench` is None where it did not."""

    control: bool = False
    wrench: bool | None = None


class _Shard:
    """What a worker keeps beside its engine: the envs of the parent it holds, and the memory shared with it."""

    def __init__(self) -> None:
        self.rows = slice(0, 0)
        self.memory: SharedArrays | None = None
        self.carried: tuple[Any, World] | None = None

    def shared(self, name: str) -> Array:
        assert self.memory is not None
        return self.memory[name][self.rows]


class HostedEngine(SimEngine):
    """Mixed into an engine's class: methods `on_...` do what a message of the parent names, unchecked.

    The parent has checked the arguments; envs are numbered as in this worker.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.__shard = _Shard()

    @property
    def first_env(self) -> int:
        """The number of env 0 in the parent."""
        return self.__shard.rows.start

    # ------------------------------------------------------------------ lifecycle

    def host(self, world: World, first: int, stop: int, layout: Layout, descriptor: int) -> None:
        """Build the envs [first, stop) of the parent, with the memory of a descriptor."""
        self.free_hosted()
        self.__shard.memory, self.__shard.rows = SharedArrays(layout, descriptor), slice(first, stop)
        self._host(world, stop - first)

    def free_hosted(self) -> None:
        """Free the world, if there is one."""
        self._clear()
        if self.__shard.memory is not None:
            self.__shard.memory.close()
            self.__shard.memory = None

    def hear(self, news: News) -> None:
        """Take over commands and wrenches from the shared memory."""
        if self._world is None:
            return
        if news.control:
            for name in Control._fields:
                getattr(self._commands.control, name)[...] = self.__shard.shared(f"control.{name}")
            self._commands.control_changed = True
        if news.wrench is not None:
            if news.wrench:
                self.__flush_control()  # the order of the base class: commands first
            self._apply_wrench(self.__shard.shared("wrench").copy() if news.wrench else None)

    def __flush_control(self) -> None:
        if self._commands.control_changed:
            self._apply_control(self._commands.control)
            self._commands.control_changed = False

    # ------------------------------------------------------------------ running

    def on_populate(self, ids: Array, present: Array) -> None:
        if self._presence.varies:
            self._retire_state()
            self._presence.write(ids, present)
            self._populate(ids)

    def on_reset(self, ids: Array) -> None:
        self._retire_state()
        self._reset(ids)

    def on_step(self, n_steps: int, ids: Array | None, fields: Sequence[str]) -> None:
        """Step, and write these fields of the state to the shared memory."""
        self._retire_state()
        self.__flush_control()
        self._step(n_steps, ids)
        self.on_read(fields)

    def on_read(self, fields: Sequence[str]) -> None:
        for name in fields:
            self.__shard.shared(name)[...] = self._read(name)

    def on_write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        self._retire_state()
        self._write_joints(ids, joints, position, velocity)

    def on_write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        self._retire_state()
        self._write_bodies(ids, bodies, pose, twist)

    # ------------------------------------------------------------------ parameters, snapshots, live editing

    def on_get_parameter(self, name: str) -> Array:
        return np.array(self._get_parameter(name))

    def on_set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        self._retire_state()
        self._set_parameter(name, values, ids, indices)
        self._records.changed[name] = None

    def on_set_parameters(self, values: Mapping[str, Array]) -> None:
        """All values (E, K, ...) of parameters of all envs of this worker."""
        for name in PARAMETERS:
            if name in values:
                self.on_set_parameter(name, values[name], self._all, np.arange(values[name].shape[1]))

    def on_default_parameter(self, name: str) -> Array:
        return np.array(self._default_parameter(name))

    def on_snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        return {name: np.array(rows) for name, rows in self._snapshot(ids, level).items()}

    def on_restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._retire_state()
        self._restore(ids, data, level)

    def on_carry(self) -> None:
        """Keep what a rebuild would lose; it stays in this process."""
        self.__shard.carried = (self._carry_rows(), self.world)

    def on_take(self) -> None:
        """Give it to what was rebuilt. A worker that was started in between has nothing to give."""
        if self.__shard.carried is not None:
            self._retire_state()
            self._take_rows(*self.__shard.carried)

    # ------------------------------------------------------------------ sensing

    def on_render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        return self._render(view, ids, channels)

    def on_raycast(self, origins: Array, directions: Array, ids: Array) -> tuple[Array, ...]:
        return tuple(self._raycast(origins, directions, ids))

    def on_contacts(self, ids: Array) -> tuple[Array, ...]:
        return tuple(self._contacts(ids))

    def on_read_back(self) -> dict[str, Array]:
        return dict(self.read_back())

    def on_handles(self) -> dict[str, int]:
        return dict(self.handles())

    def on_renderer_name(self) -> str:
        return self.renderer_name()


def hosted_class(path: str) -> type[HostedEngine]:
    """The class of a worker for the engine `module:Class`."""
    module, _, name = path.partition(":")
    engine: Any = importlib.import_module(module)
    for part in name.split("."):
        engine = getattr(engine, part)
    return type(f"Hosted{engine.__name__}", (HostedEngine, engine), {})
