"""The commit protocol: everything on the disk, then one rename that makes it visible."""

import hashlib
import os
from collections.abc import Iterable
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
    """Make a sealed directory visible under its final name, by one rename. Never replaces a directory with content.

    Raises:
        OSError: it is not visible, unless even taking it back failed.
    """
    fsync(incoming)
    incoming.rename(final)
    try:
        fsync(final.parent)
    except OSError:
        final.rename(incoming)
        raise
