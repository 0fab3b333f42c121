"""The directory in which trajectories are written before they are committed, shared by all recorders of a run.

Each recorder owns a locked file there, `<pid>-<n>.lock`, and its attempts end in `.<pid>-<n>`. An attempt whose
recorder is not alive is an orphan. A lock is a file that its owner keeps locked, and the kernel unlocks when that dies;
a process number says less: it is used again, and means nothing on another machine that shares the directory.
"""

import fcntl
import os
import platform
import shutil
from itertools import count
from pathlib import Path
from typing import Self

from anysim.errors import RecordError
from anysim.record.names import COLLECTING, INCOMING, STARTUP_LOCK, attempt_name, owner_of


class FileLock:
    """An exclusive lock on a file that exists as long as the lock is held."""

    def __init__(self, path: Path, descriptor: int) -> None:
        self.path = path
        self._descriptor: int | None = descriptor

    @classmethod
    def take(cls, path: Path, wait: bool = False) -> "FileLock | None":
        """The lock, or None where `wait` is false and a live process holds it.

        Raises:
            OSError: the file cannot be made, for instance because its directory is gone.
        """
        while True:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
                if _is_still(path, descriptor):
                    return cls(path, descriptor)
            except BlockingIOError:
                os.close(descriptor)
                return None
            except BaseException:
                os.close(descriptor)
                raise
            # the owner removed the file while we waited for it: what we hold is the lock of a file without a name
            os.close(descriptor)

    def release(self) -> None:
        """Remove the file and unlock it. Further calls do nothing."""
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        try:
            self.path.unlink(missing_ok=True)
        finally:
            os.close(descriptor)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


def claim(run: Path) -> FileLock:
    """The right to run the episodes of a directory, of one collector at a time.

    Raises:
        RecordError: another one, alive, has it.
        OSError: the directory cannot be written.
    """
    run.mkdir(parents=True, exist_ok=True)
    path = run / COLLECTING
    lock = FileLock.take(path)
    if lock is None:
        try:
            owner = path.read_text().strip()
        except OSError:
            owner = ""
        raise RecordError(
            f"another run{f' ({owner})' if owner else ''} is recording into {run} now; wait until it has ended and run "
            "the same command again, which goes on from there, or record into another directory"
        )
    path.write_text(f"process {os.getpid()} on {platform.node()}\n")
    return lock


def _is_still(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


class Incoming:
    """One recorder's part of the incoming directory."""

    def __init__(self, run: Path) -> None:
        """Join, and remove orphans.

        Raises:
            OSError: the directory cannot be written.
        """
        self.path = run / INCOMING
        with self.startup():
            self.swept = self._sweep()
            self._lock = self._own_lock()
        self.owner = self._lock.path.stem

    def startup(self) -> FileLock:
        """Held while a recorder starts, so that two of them don't sweep or describe the run at once."""
        while True:
            self.path.mkdir(parents=True, exist_ok=True)
            try:
                lock = FileLock.take(self.path / STARTUP_LOCK, wait=True)
            except FileNotFoundError:
                continue  # another recorder closed and removed the empty directory in between
            assert lock is not None
            return lock

    def attempt(self, env: int, episode: int) -> Path:
        """A new, empty directory for one trajectory."""
        path = self.path / attempt_name(env, episode, self.owner)
        try:
            path.mkdir()
        except FileExistsError:  # of an earlier attempt of ours that could not be removed then
            remove(path)
            path.mkdir()
        return path

    def close(self) -> None:
        """Leave, and remove the directory if no other recorder is in it; what stays is swept by the next one."""
        try:
            self._lock.release()
            self.path.rmdir()
        except OSError:
            return

    def _own_lock(self) -> FileLock:
        for number in count():
            lock = FileLock.take(self.path / f"{os.getpid()}-{number}.lock")
            if lock is not None:
                return lock
        raise AssertionError("count() ends never")

    def _sweep(self) -> tuple[str, ...]:
        """Remove what belongs to recorders that are gone. Returns the names of the attempts."""
        entries = [(entry, owner_of(entry.name)) for entry in self.path.iterdir()]
        swept: list[str] = []
        for owner in sorted({owner for _, owner in entries if owner is not None}):
            lock = FileLock.take(self.path / f"{owner}.lock")
            if lock is None:
                continue
            with lock:
                for entry, other in entries:
                    if other == owner and entry != lock.path:
                        remove(entry)
                        swept.append(entry.name)
        return tuple(sorted(swept))


def remove(path: Path) -> None:
    """Remove a directory and all in it; gone already is fine."""
    try:
        shutil.rmtree(path)
    except FileNotFoundError:
        return
