"""The committer of a run: writes images and ended episodes on a thread of its own, and makes trajectories visible.

The thread does tasks in the order in which they were handed over, from a queue of bounded size. Trajectories that end
at about the same time are written aside one after the other and published together.
"""

import threading
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record import commit as protocol
from anysim.record.columns import EpisodeColumns
from anysim.record.commit import disk_trouble, taken
from anysim.record.header import RunHeader
from anysim.record.names import EPISODES
from anysim.record.writer import PartWriter, TrajectoryWriter
from anysim_recording.trajectory_files import Ending, ManifestText, PendingCommit, TrajectoryFiles

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


GROUP = 16
"""At most as many trajectories become visible together."""
PATIENCE = 64
"""A written trajectory waits for others to be published with during at most as many tasks."""


class Committer:
    """Takes tasks of the stepping thread and does them in their order. Public methods are the stepping thread's."""

    def __init__(self, out: Path, writer: TrajectoryWriter, run: RunHeader) -> None:
        self._out, self._writer, self._run = out, writer, run
        self._thread = RecordingThread(self._after_task)
        self._pending: list[PendingCommit] = []
        self._text: ManifestText | None = None  # as all below, of the thread alone
        self._ready: list[tuple[PendingCommit, TrajectoryFiles, Path]] = []
        self._waited = 0

    @property
    def thread_ident(self) -> int | None:
        """The thread's identifier as of `threading`, or None while it has not been needed."""
        return self._thread.ident

    def refuse_taken(self, final: Path) -> None:
        """See that a trajectory is neither there nor about to be.

        Raises:
            RecordError: it is.
        """
        self._pending = [c for c in self._pending if not c.done or (c.failed and not c.told)]
        if final.exists() or any(c.path == final and not c.done for c in self._pending):
            raise RecordError(taken(final))

    def open_part(self, files: TrajectoryFiles, kind: str, call: Callable[[Path], PartWriter]) -> None:
        """Begin the `images` or `streams` of a trajectory."""
        self._thread.put(lambda: self._prepared(files, partial(files.open_part, kind, call)))

    def append_images(self, files: TrajectoryFiles, step: int, images: Mapping[str, Array]) -> None:
        """Write the images of a control step; the arrays are the committer's from here on."""
        size = sum(image.nbytes for image in images.values())
        self.append_to(files, "images", f"step {step}", lambda writer: writer.append(images), size)

    def append_to(
        self, files: TrajectoryFiles, kind: str, what: str, call: Callable[[Any], None], nbytes: int = 0
    ) -> None:
        """Call the writer of a part of a trajectory, which holds so much memory until then."""
        self._thread.put(partial(files.append_to, kind, what, call), nbytes)

    def abort(self, files: TrajectoryFiles) -> None:
        """Remove what was written of a trajectory."""
        self._thread.put(lambda: _aborted(files))

    def commit(self, final: Path, files: TrajectoryFiles, columns: EpisodeColumns, ending: Ending) -> PendingCommit:
        """Write an episode that has ended, and make it visible at `final`."""
        pending = PendingCommit(final)
        self._pending.append(pending)
        self._thread.put(lambda: self._write(pending, files, columns, ending), columns.nbytes)
        return pending

    def flush(self) -> None:
        """Wait until all tasks are done."""
        self._thread.wait()

    def stop(self) -> None:
        """Wait until all tasks are done, and end the thread."""
        self._thread.stop()

    def raise_untold(self) -> None:
        """Raise the first failure that was not waited for.

        Raises:
            RecordError: there is one.
        """
        for pending in self._pending:
            if pending.failed and not pending.told:
                pending.wait()

    # ------------------------------------------------------------------ on the thread

    def _prepared(self, files: TrajectoryFiles, call: Callable[[], None]) -> None:
        """Call what needs a prepared writer."""
        try:
            if self._text is None:
                with registry.Blame(f"the writer '{self._writer.name}'", registry.origin(self._writer)):
                    self._writer.prepare(self._run)
                self._text = ManifestText(self._run, self._writer.name)
        except BaseException as error:  # noqa: BLE001  raised at the next append or commit
            files.trouble = error
        else:
            call()

    def _write(self, pending: PendingCommit, files: TrajectoryFiles, columns: EpisodeColumns, ending: Ending) -> None:
        def write() -> None:
            assert self._text is not None
            self._ready.append((pending, files, files.write(columns, ending, self._text)))

        try:
            self._prepared(files, write)
            if files.trouble is not None:
                raise files.trouble
        except BaseException as error:  # noqa: BLE001  raised where the commit is waited for
            self._fail(pending, files, error)

    def _after_task(self, idle: bool) -> None:
        self._waited = self._waited + 1 if self._ready else 0
        if self._ready and (idle or len(self._ready) >= GROUP or self._waited >= PATIENCE):
            self._publish()

    def _publish(self) -> None:
        """Make what is written visible, all at once."""
        ready, self._ready = self._ready, []
        episodes = self._out / EPISODES
        errors: list[OSError | None]
        try:
            if not episodes.exists():
                episodes.mkdir(exist_ok=True)
                protocol.fsync(self._out)
            errors = protocol.publish_all([(directory, pending.path) for pending, _, directory in ready])
        except OSError as error:
            errors = [error] * len(ready)
        for (pending, files, _), error in zip(ready, errors, strict=True):
            if error is None:
                pending.settle(None)
                continue
            trouble = disk_trouble(f"cannot commit {files.where}", error, self._out)
            trouble.__cause__ = error
            self._fail(pending, files, trouble)

    def _fail(self, pending: PendingCommit, files: TrajectoryFiles, error: BaseException) -> None:
        _aborted(files, error)
        pending.settle(error)


def _aborted(files: TrajectoryFiles, error: BaseException | None = None) -> None:
    """Abort; what goes wrong in that is noted with the error for which it is done, if there is one."""
    try:
        files.abort()
    except Exception as another:  # noqa: BLE001  a plugin's
        if error is not None:
            error.add_note(f"and then: {another}")
