"""The recorder's thread: tasks in the order in which they were handed over, and a queue of bounded size."""

import threading
from collections import deque
from collections.abc import Callable

QUEUE_BYTES = 64 << 20
"""What waits for the thread may hold as much memory; who hands over more waits."""
SMALLEST = 1 << 20
"""Each task counts as at least as many bytes, so that not too many wait."""


class RecordingThread:
    """Runs tasks one after the other. Tasks do not raise: what goes wrong in one is its own to keep."""

    def __init__(self, after_task: Callable[[bool], None]) -> None:
        """`after_task` is called in the thread after each task, and told whether no other one is waiting."""
        self._after_task = after_task
        self._tasks: deque[tuple[Callable[[], None], int]] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._busy = self._stopping = False
        self._thread: threading.Thread | None = None

    @property
    def ident(self) -> int | None:
        """The thread's identifier as of `threading`, or None while it has not been needed."""
        return None if self._thread is None else self._thread.ident

    def put(self, task: Callable[[], None], nbytes: int = 0) -> None:
        """Hand a task over; waits while too much is waiting already."""
        size = max(nbytes, SMALLEST)
        with self._changed:
            if self._thread is None:
                # a daemon: who never closes the recorder can still end, and loses what was not committed yet
                self._thread = threading.Thread(target=self._run, name="anysim-record", daemon=True)
                self._thread.start()
            while self._tasks and self._bytes + size > QUEUE_BYTES:
                self._changed.wait()
            self._tasks.append((task, size))
            self._bytes += size
            self._changed.notify_all()

    def wait(self) -> None:
        """Return when all tasks are done."""
        with self._changed:
            while self._tasks or self._busy:
                self._changed.wait()

    def stop(self) -> None:
        """Do what is waiting, and end. No task may be put afterwards."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                while not self._tasks and not self._stopping:
                    self._changed.wait()
                if not self._tasks:
                    return
                task, size = self._tasks.popleft()
                self._bytes -= size
                self._busy = True
                self._changed.notify_all()
            task()
            with self._changed:
                idle = not self._tasks
            self._after_task(idle)
