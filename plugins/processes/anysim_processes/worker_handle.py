"""The parent's side of one worker process: start, ask, answer, end.

A worker is started as a program of its own, not through multiprocessing's `spawn`: that would run the user's main
module again, which a script without a `__main__` guard does not survive. Messages are tuples of plain values, arrays
and the frozen World, over a socket pair that no other process can reach.
"""

import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.spawn import get_executable
from typing import Any

from anysim import errors
from anysim.errors import AnysimError, EngineError
from anysim_processes.own_process import ParentWatch, how_it_ended

_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from {} import main; main(int(sys.argv[2]), int(sys.argv[3]))"
)
GRACE_S = 10.0
"""How long a worker may take to free its engine and end by itself [s]."""


THREAD_POOLS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "LP_NUM_THREADS")
"""The variables that size the thread pools of the libraries engines compute and draw with."""


@contextmanager
def _one_message() -> Iterator[None]:
    """Within it Ctrl-C waits: after half a message nobody could tell where the next one begins."""
    handler = signal.getsignal(signal.SIGINT) if threading.current_thread() is threading.main_thread() else None
    if not callable(handler):  # the signal is ignored, or raises nothing in this thread
        yield
        return
    came = list[tuple[int, Any]]()
    signal.signal(signal.SIGINT, lambda *words: came.append(words))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if came:
            handler(*came[0])


class WorkerLost(Exception):
    """A worker that ended or does not answer; the text says how."""


class Worker:
    """One worker process. Every message has a number and is answered; an answer to an earlier one is dropped.

    `module` has `main(connection, parent_watch)`, which gets two file descriptors.
    """

    def __init__(self, environment: dict[str, str], timeout_s: float, module: str) -> None:
        self._timeout = timeout_s
        self._sent = 0
        own, theirs = socket.socketpair()
        parent_watch = ParentWatch()
        try:
            self._process = subprocess.Popen(
                [
                    get_executable(),
                    "-P",
                    "-c",
                    _PROGRAM.format(module),
                    json.dumps(sys.path),
                    str(theirs.fileno()),
                    str(parent_watch.worker_end),
                ],
                pass_fds=(theirs.fileno(), parent_watch.worker_end),
                stdin=subprocess.DEVNULL,
                env=environment,
            )
        except BaseException:
            own.close()
            parent_watch.release()
            raise
        finally:
            theirs.close()
            parent_watch.handed_over()
        self._parent_watch, self._socket = parent_watch, own
        # a message larger than the socket's buffer must not wait for ever for a worker that stopped reading it
        limit = struct.pack("ll", int(timeout_s), int(timeout_s % 1 * 1e6))
        own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)
        own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)
        self._connection = Connection(os.dup(own.fileno()))
        self._arrival = select.poll()  # once: Connection.poll makes a selector for each call
        self._arrival.register(own, select.POLLIN)

    @property
    def pid(self) -> int:
        """The process id."""
        return self._process.pid

    def post(self, message: tuple[Any, ...], descriptor: int | None = None) -> None:
        """Send a message, with a file descriptor if there is one.

        Raises:
            WorkerLost: it is gone.
        """
        self._sent += 1  # before all else: whatever Ctrl-C interrupts from here on, the number is not used again
        try:
            with _one_message():
                while self._arrival.poll(0):  # of calls that were interrupted; their worker may be waiting to write
                    self._connection.recv()
                self._connection.send((self._sent, *message))
                if descriptor is not None:
                    socket.send_fds(self._socket, [b"+"], [descriptor])
        except BlockingIOError:
            raise WorkerLost(self._hangs(self._timeout)) from None
        except (EOFError, OSError):
            raise WorkerLost(self._how_it_ended()) from None

    def has_news(self, limit: float) -> bool:
        """Whether an answer, or its end, comes within `limit` [s]."""
        return bool(self._arrival.poll(limit * 1e3))

    def answer(self, deadline: float, limit: float) -> Any:
        """The answer to the last message, by a time of `time.perf_counter()`; `limit` [s] is for the message.

        Raises:
            WorkerLost: it is gone, or too late and was killed.
            AnysimError: what the engine raised in the worker.
        """
        number, kind, *content = self._receive(deadline, limit)
        while number != self._sent:  # of a call that was interrupted: the worker turns to this one only now
            number, kind, *content = self._receive(time.perf_counter() + limit, limit)
        if kind == "error":
            raise _raised(*content)
        return content[0]

    def _receive(self, deadline: float, limit: float) -> tuple[Any, ...]:
        try:
            if not self.has_news(max(0.0, deadline - time.perf_counter())):
                raise WorkerLost(self._hangs(limit))
            with _one_message():
                return self._connection.recv()
        except BlockingIOError:
            raise WorkerLost(self._hangs(self._timeout)) from None
        except (EOFError, OSError, ValueError):  # ValueError: closed here, when it was lost before
            raise WorkerLost(self._how_it_ended()) from None

    def _hangs(self, limit: float) -> str:
        self.kill()
        return f"did not answer within {limit:g} s and was killed"

    def _how_it_ended(self) -> str:
        try:
            code = self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self.kill()
            return "closed its connection and was killed"
        return how_it_ended(code) or "ended with exit code 0"

    def part(self) -> None:
        """Ask it to end, without waiting."""
        try:
            self._socket.settimeout(0.0)
            self._connection.send((0, "stop", None))
        except OSError:
            pass

    def close(self, grace_s: float = GRACE_S) -> None:
        """Wait until it has ended after `part`, kill it if it does not, and release what belonged to it."""
        try:
            self._process.wait(grace_s)
        except subprocess.TimeoutExpired:
            pass
        finally:
            self.kill()

    def kill(self) -> None:
        """End it now, if it is still there, and release what belonged to it."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._parent_watch.release()
        self._connection.close()
        self._socket.close()


def _raised(name: str, message: str) -> AnysimError:
    """The error of the worker, of the same type where a message makes one."""
    kind = getattr(errors, name, EngineError)
    return EngineError(message) if kind is errors.SpecError else kind(message)
