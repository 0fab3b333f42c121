"""The worker's side: hold an engine for a block of envs, and do what the parent asks, one message after the other."""

import faulthandler
import importlib
import os
import select
import signal
import socket
import time
import traceback
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.control import Control
from anysim.engine.parameters import PARAMETERS
from anysim.engine.sharded.parent_watch import hang_on
from anysim.engine.sharded.shared_memory import Layout, SharedArrays
from anysim.engine.state import SnapshotLevel
from anysim.errors import AnysimError
from anysim.model.world import World

# ruff: noqa: SLF001  the worker drives the primitives of an engine, as the base class does in one process


LINGER_S = 3e-4
"""How long a worker waits awake for its next message [s]. One that sleeps is often woken on a core that is in use, and
starts milliseconds late: two shards on two cores gained 1.5 to 1.6 times without this, 1.85 with it."""


class News(NamedTuple):
    """What changed in the shared memory since the last message to this worker; `wrench` is None where it did not."""

    control: bool = False
    wrench: bool | None = None


def main(connection: int, lifeline: int) -> None:
    """Serve until the parent says stop, or ends. Ctrl-C reaches the parent, which decides what becomes of this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    hang_on(lifeline)
    faulthandler.enable()  # a crash in an engine's library says where
    with socket.socket(fileno=connection) as channel, Connection(channel.detach()) as pipe:
        Host(pipe).serve()


class Host:
    """The engine of a worker. Methods without an underscore are what a message may name."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._arrival = select.poll()
        self._arrival.register(pipe.fileno(), select.POLLIN)
        self._engine: SimEngine | None = None
        self._memory: SharedArrays | None = None
        self._rows = slice(0)
        self._carried: tuple[Any, World] | None = None

    def serve(self) -> None:
        """Answer messages: `("done", result)`, or `("error", type, message)`."""
        while True:
            try:
                self._linger()
                name, news, *arguments = self._pipe.recv()
            except (EOFError, OSError):
                break
            if name == "stop":
                break
            try:
                self._hear(news)
                answer = ("done", getattr(self, name)(*arguments))
            except AnysimError as error:
                answer = ("error", type(error).__name__, self._placed(str(error)))
            except Exception as error:  # noqa: BLE001 - whatever an engine raises, the parent shows it
                text = f"{type(error).__name__}: {error}\nin the worker:\n{traceback.format_exc()}"
                answer = ("error", "EngineError", text)
            try:
                self._pipe.send(answer)
            except OSError:
                break
        self.free()

    def _linger(self) -> None:
        """Stay awake for the next message, leaving the core to whoever wants it."""
        until = time.perf_counter() + LINGER_S
        while not self._arrival.poll(0) and time.perf_counter() < until:
            os.sched_yield()

    def _placed(self, message: str) -> str:
        """An error that names an env by its number here says so."""
        first = self._rows.start
        return f"{message} (in a worker, whose env 0 is env {first})" if first and "env " in message else message

    # ------------------------------------------------------------------ lifecycle

    def load(self, path: str, options: Mapping[str, Any]) -> None:
        """Import `module:Class` and make the engine."""
        module, _, name = path.partition(":")
        engine_class = importlib.import_module(module)
        for part in name.split("."):
            engine_class = getattr(engine_class, part)
        self._engine = engine_class(**options)  # pyright: ignore[reportCallIssue]

    def build(self, world: World, first: int, stop: int, layout: Layout) -> None:
        """Build the envs [first, stop) of the parent; the descriptor of the shared memory follows the message."""
        with socket.socket(fileno=self._pipe.fileno()) as channel:
            try:
                _, descriptors, *_ = socket.recv_fds(channel, 1, 1)
            finally:
                channel.detach()
        self.free()
        engine = self._engine
        assert engine is not None
        self._memory, self._rows = SharedArrays(layout, descriptors[0]), slice(first, stop)
        engine.num_envs = stop - first
        engine._install(world)
        try:
            engine._build(world, engine.num_envs)
        except BaseException:
            engine._world = None
            raise

    def free(self) -> None:
        """Free the world, if there is one."""
        engine = self._engine
        if engine is not None and engine._world is not None:
            engine._retire_state()
            engine._free()
            engine._world = None
        if self._memory is not None:
            self._memory.close()
            self._memory = None

    def _hear(self, news: News | None) -> None:
        """Take over commands and wrenches from the shared memory."""
        engine = self._engine
        if news is None or engine is None or engine._world is None:
            return
        if news.control:
            for name in Control._fields:
                getattr(engine._commands.control, name)[...] = self._shared(f"control.{name}")
            engine._commands.control_changed = True
        if news.wrench is not None:
            if news.wrench:
                self._flush_control()  # the order of the base class: commands first
            engine._apply_wrench(self._shared("wrench").copy() if news.wrench else None)

    def _shared(self, name: str) -> Array:
        assert self._memory is not None
        return self._memory[name][self._rows]

    def _flush_control(self) -> None:
        commands = self._here._commands
        if commands.control_changed:
            self._here._apply_control(commands.control)
            commands.control_changed = False

    @property
    def _here(self) -> SimEngine:
        assert self._engine is not None
        return self._engine

    # ------------------------------------------------------------------ running

    def populate(self, ids: Array, present: Array) -> None:
        engine = self._here
        if engine._presence.varies:
            engine._retire_state()
            engine._presence.write(ids, present)
            engine._populate(ids)

    def reset(self, ids: Array) -> None:
        self._here._retire_state()
        self._here._reset(ids)

    def step(self, n_steps: int, ids: Array | None, fields: Sequence[str]) -> None:
        """Step, and write these fields of the state to the shared memory."""
        self._here._retire_state()
        self._flush_control()
        self._here._step(n_steps, ids)
        self.read(fields)

    def read(self, fields: Sequence[str]) -> None:
        for name in fields:
            self._shared(name)[...] = self._here._read(name)

    def write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        self._here._retire_state()
        self._here._write_joints(ids, joints, position, velocity)

    def write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        self._here._retire_state()
        self._here._write_bodies(ids, bodies, pose, twist)

    def processor_time(self) -> float:
        return time.process_time()

    # ------------------------------------------------------------------ parameters, snapshots, live editing

    def get_parameter(self, name: str) -> Array:
        return np.array(self._here._get_parameter(name))

    def set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        self._here._retire_state()
        self._here._set_parameter(name, values, ids, indices)
        self._here._changed[name] = None

    def set_parameters(self, values: Mapping[str, Array]) -> None:
        """All values (E, K, ...) of parameters of all envs of this worker."""
        for name in PARAMETERS:
            if name in values:
                self.set_parameter(name, values[name], self._here._all, np.arange(values[name].shape[1]))

    def default_parameter(self, name: str) -> Array:
        return np.array(self._here._default_parameter(name))

    def snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        return {name: np.array(rows) for name, rows in self._here._snapshot(ids, level).items()}

    def restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        self._here._retire_state()
        self._here._restore(ids, data, level)

    def carry(self) -> None:
        """Keep what a rebuild would lose; it stays in this process."""
        self._carried = (self._here._carry_rows(), self._here.world)

    def take(self) -> None:
        """Give it to what was rebuilt. A worker that was started in between has nothing to give."""
        if self._carried is not None:
            self._here._retire_state()
            self._here._take_rows(*self._carried)

    # ------------------------------------------------------------------ sensing

    def render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        return self._here._render(view, ids, channels)

    def raycast(self, origins: Array, directions: Array, ids: Array) -> tuple[Array, ...]:
        return tuple(self._here._raycast(origins, directions, ids))

    def contacts(self, ids: Array) -> tuple[Array, ...]:
        return tuple(self._here._contacts(ids))

    def read_back(self) -> dict[str, Array]:
        return dict(self._here.read_back())

    def handles(self) -> dict[str, int]:
        return dict(self._here.handles())

    def renderer_name(self) -> str:
        return self._here.renderer_name()
