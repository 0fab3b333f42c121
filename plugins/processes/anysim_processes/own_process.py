"""Processes of their own: a module run with a time limit, and the end of a child whose parent died.

A crash or a hang there is a sentence here. The parent of a worker holds the write end of a pipe that carries nothing.
When the parent ends, by whatever cause, the kernel closes that end. On Linux it then kills the worker by itself;
elsewhere a thread of the worker notices and ends it.
"""

import os
import select
import signal
import subprocess
import sys
import threading
from typing import NamedTuple


class ProcessEnd(NamedTuple):
    """What a process printed, and `trouble`: how it ended, in words, or empty where it ended well."""

    out: str
    err: str
    trouble: str


def run_module(module: str, *arguments: str, limit: float) -> ProcessEnd:
    """Run `python -m module arguments` for at most `limit` seconds; what it printed until then comes back."""
    command = (sys.executable, "-m", module, *arguments)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            out, err = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            return ProcessEnd(out, err, f"took longer than {limit:g} s and was stopped")
        except BaseException:
            process.kill()
            raise
    return ProcessEnd(out, err, how_it_ended(process.returncode))


def how_it_ended(code: int) -> str:
    """Words for an exit code, below 0 for a signal; empty for 0."""
    if code >= 0:
        return f"ended with exit code {code}" if code else ""
    name = signal.Signals(-code).name if -code in set(signal.Signals) else "unknown"
    return f"was ended by signal {-code} ({name})"


_HELD: set[int] = set()
"""The write ends that this process holds."""

_FORK_IS_WATCHED = threading.Event()


class ParentWatch:
    """The parent's end; `worker_end` is for the worker, and closed here once the worker has it."""

    def __init__(self) -> None:
        if not _FORK_IS_WATCHED.is_set():
            _FORK_IS_WATCHED.set()
            os.register_at_fork(after_in_child=_let_go)
        self.worker_end, self._own = os.pipe()
        _HELD.add(self._own)

    def handed_over(self) -> None:
        """Close the worker's end in this process."""
        os.close(self.worker_end)

    def release(self) -> None:
        """Let a worker that is still there be killed."""
        if self._own in _HELD:
            _HELD.discard(self._own)
            os.close(self._own)


def _let_go() -> None:
    """In a fork of the parent: the copies would keep workers alive after the parent's end."""
    for end in _HELD:
        os.close(end)
    _HELD.clear()


def end_with_parent(end: int) -> None:
    """Called in the worker with its end: from now on it does not outlive its parent."""
    if sys.platform == "linux":
        import fcntl

        # the pipe becomes readable for the first and only time when its other end closes; the kernel then sends the
        # signal, which works in a process that is stopped or is busy in C code
        fcntl.fcntl(end, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(end, fcntl.F_SETSIG, signal.SIGKILL)
        fcntl.fcntl(end, fcntl.F_SETFL, fcntl.fcntl(end, fcntl.F_GETFL) | os.O_ASYNC)
        if select.select([end], [], [], 0)[0]:  # the parent ended before
            os._exit(1)
    else:

        def watch() -> None:
            os.read(end, 1)
            os._exit(1)

        threading.Thread(target=watch, name="anysim-parent-watch", daemon=True).start()
