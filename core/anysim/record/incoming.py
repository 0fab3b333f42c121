"""The directory in which trajectories are written before they are committed, shared by all recorders of a run.

Each recorder owns a locked file there, `<pid>-<n>.lock`, and its attempts end in `.<pid>-<n>`. What belongs to nobody
alive is an orphan.
"""

import os
import shutil
from itertools import count
from pathlib import Path

from anysim.record.lock import FileLock
from anysim.record.names import INCOMING, STARTUP_LOCK, attempt_name, owner_of


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
        """Leave, and remove the directory if nobody else is in it. What stays behind, the next recorder sweeps."""
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
