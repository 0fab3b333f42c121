"""A worker dies with its parent, also when the parent is killed and when the worker hangs or is stopped.

The parent holds the write end of a pipe that carries nothing. When the parent ends, by whatever cause, the kernel
closes that end. On Linux it then kills the worker by itself; elsewhere a thread of the worker notices and ends it.
"""

import os
import select
import signal
import sys
import threading

_HELD: set[int] = set()
"""The write ends that this process holds."""

_FORK_IS_WATCHED = threading.Event()


class Lifeline:
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

    def cut(self) -> None:
        """Let a worker that is still there be killed."""
        if self._own in _HELD:
            _HELD.discard(self._own)
            os.close(self._own)


def _let_go() -> None:
    """In a fork of the parent: the copies would keep workers alive after the parent's end."""
    for end in _HELD:
        os.close(end)
    _HELD.clear()


def hang_on(end: int) -> None:
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

        threading.Thread(target=watch, name="anysim-lifeline", daemon=True).start()
