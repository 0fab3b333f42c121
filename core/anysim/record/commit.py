"""The commit protocol: everything on the disk, then one rename for each trajectory that makes it visible.

Trajectories that wait at the same time share the last step: their directories are brought to the disk and renamed one
after the other, and then the directory that they are in now is brought to the disk once for all.
"""

import hashlib
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from anysim.record.manifest import FileEntry


def fsync(path: Path) -> None:
    """Wait until a file, or the entries of a directory, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def seal(directory: Path, names: Iterable[str]) -> dict[str, FileEntry]:
    """Bring finished files to the disk and describe them by size and SHA-256."""
    entries: dict[str, FileEntry] = {}
    for name in names:
        path = directory / name
        fsync(path)
        entries[name] = describe(path)
    return entries


def describe(path: Path) -> FileEntry:
    """Size and SHA-256 of a file."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return FileEntry(bytes=file.tell(), sha256=digest)


def write_durably(path: Path, data: bytes) -> None:
    """A new file, on the disk when this returns."""
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def publish(incoming: Path, final: Path) -> None:
    """Make a sealed file or directory visible under its final name, by one rename.

    A directory with content is never replaced.

    Raises:
        OSError: it is not visible, unless even taking it back failed.
    """
    [error] = publish_all([(incoming, final)])
    if error is not None:
        raise error


def publish_all(moves: Sequence[tuple[Path, Path]]) -> list[OSError | None]:
    """Make sealed entries visible in one directory, each (incoming, final) by one rename, all with one last fsync.

    Returns:
        For each, the error for which it is not visible, or None. If the last fsync fails, all are taken back.
    """
    errors: list[OSError | None] = []
    for incoming, final in moves:
        try:
            fsync(incoming)
            incoming.rename(final)
        except OSError as error:
            errors.append(error)
        else:
            errors.append(None)
    done = [place for place, error in enumerate(errors) if error is None]
    try:
        if done:
            fsync(moves[done[0]][1].parent)
    except OSError as error:
        for place in done:
            incoming, final = moves[place]
            with suppress(OSError):  # where even this fails it stays, and is whole
                final.rename(incoming)
            errors[place] = error
    return errors
