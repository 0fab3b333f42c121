"""Program of a worker process: hold an engine for a block of envs and answer the parent's messages, one by one."""

import faulthandler
import os
import select
import signal
import socket
import time
import traceback
from collections.abc import Mapping
from multiprocessing.connection import Connection
from typing import Any

from anysim.errors import AnysimError
from anysim.model.world import World
from anysim_processes.own_process import end_with_parent
from anysim_processes.shared_memory import Layout
from anysim_sharded.hosted import HostedEngine, hosted_class

LINGER_S = 3e-4
"""How long a worker waits awake for its next message [s]. One that sleeps is often woken on a core that is in use, and
starts milliseconds late: two shards on two cores gained 1.5 to 1.6 times without this, 1.85 with it."""


def main(connection: int, parent_watch: int) -> None:
    """Serve until the parent says stop, or ends. Ctrl-C reaches the parent, which decides what becomes of this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(parent_watch)
    faulthandler.enable()  # a crash in an engine's library says where
    with socket.socket(fileno=connection) as channel, Connection(channel.detach()) as pipe:
        Host(pipe).serve()


class Host:
    """The engine of a worker and its connection. Methods without an underscore are what a message may name.

    So are those of `HostedEngine` that begin with `on_`, under the rest of their name.
    """

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._arrival = select.poll()
        self._arrival.register(pipe.fileno(), select.POLLIN)
        self._engine: HostedEngine | None = None

    def serve(self) -> None:
        """Answer messages, each by its number: `(number, "done", result)`, or `(number, "error", type, message)`."""
        while True:
            try:
                self._linger()
                number, name, news, *arguments = self._pipe.recv()
            except (EOFError, OSError):
                break
            if name == "stop":
                break
            try:
                if news is not None and self._engine is not None:
                    self._engine.hear(news)
                called = getattr(self, name, None) or getattr(self._engine, f"on_{name}")
                answer = ("done", called(*arguments))
            except AnysimError as error:
                answer = ("error", type(error).__name__, self._placed(str(error)))
            except Exception as error:  # noqa: BLE001 - whatever an engine raises, the parent shows it
                text = f"{type(error).__name__}: {error}\nin the worker:\n{traceback.format_exc()}"
                answer = ("error", "EngineFailure", text)
            try:
                self._pipe.send((number, *answer))
            except OSError:
                break
        self.free()

    def _linger(self) -> None:
        """Stay awake for the next message, leaving the core to any other process that wants it."""
        until = time.perf_counter() + LINGER_S
        while not self._arrival.poll(0) and time.perf_counter() < until:
            os.sched_yield()

    def _placed(self, message: str) -> str:
        """An error that names an env by its number here says so."""
        first = 0 if self._engine is None else self._engine.first_env
        return f"{message} (in a worker, whose env 0 is env {first})" if first and "env " in message else message

    def load(self, path: str, options: Mapping[str, Any]) -> None:
        """Import `module:Class` and make the engine."""
        self._engine = hosted_class(path)(**options)

    def build(self, world: World, first: int, stop: int, layout: Layout) -> None:
        """Build the envs [first, stop) of the parent; the descriptor of the shared memory follows the message."""
        with socket.socket(fileno=self._pipe.fileno()) as channel:
            try:
                _, descriptors, *_ = socket.recv_fds(channel, 1, 1)
            finally:
                channel.detach()
        assert self._engine is not None
        self._engine.host(world, first, stop, layout, descriptors[0])

    def free(self) -> None:
        """Free the world, if there is one."""
        if self._engine is not None:
            self._engine.free_hosted()

    def processor_time(self) -> float:
        """Processor time [s] of this process so far."""
        return time.process_time()
