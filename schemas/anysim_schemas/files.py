"""Plain files of bounded size: no device, pipe or socket is opened for reading, and no file is read without end."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

from anysim_schemas.limits import Limit

_MARKERS = ("pyproject.toml", "package.xml", ".git")


class RefusedFileError(OSError):
    """A file that is not read, whatever it holds; `strerror` continues a sentence that begins with its name."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(errno.EPERM, reason, str(path))


LONGEST_NAME, LONGEST_PATH = 255, 4096
"""Bytes: what file systems take for one name, and for a path."""


def name_problem(text: str) -> str:
    """Why a text cannot be the path of a file on any machine, to follow `which`; empty if it can be one."""
    try:
        data = text.encode()
    except UnicodeEncodeError:
        return "holds a character that no file name can have"
    if b"\0" in data:
        return "holds a NUL, which no file name can have"
    if len(data) > LONGEST_PATH or any(len(part) > LONGEST_NAME for part in data.split(b"/")):
        return f"is longer than a file name can be ({LONGEST_NAME} bytes, {LONGEST_PATH:,} for a path)"
    return ""


def exists(path: str | Path) -> bool:
    """Whether something is there; nothing is where the text is no path at all."""
    try:
        return Path(path).exists()
    except (OSError, ValueError):  # too long for a name, or with a NUL
        return False


def open_plain(path: Path) -> BinaryIO:
    """A plain file, open for reading.

    Raises:
        RefusedFileError: it is a device, a pipe, a socket or a directory.
        OSError: it cannot be opened.
    """
    try:
        # without blocking: opening a pipe would wait for a writer
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | getattr(os, "O_NONBLOCK", 0))
    except ValueError as error:  # a NUL in its name
        raise RefusedFileError(path, f"cannot be the name of a file: {error}") from None
    return os.fdopen(_checked(descriptor, path), "rb")


def read_plain(path: Path, limit: Limit) -> bytes:
    """The content of a plain file.

    Raises:
        RefusedFileError: see `open_plain`; it has more bytes than the limit.
        OSError: it cannot be opened or read.
    """
    with open_plain(path) as file:
        size = os.fstat(file.fileno()).st_size
        if limit.exceeded(size):
            raise RefusedFileError(path, limit.sentence(size))
        data = file.read(size + 1)  # not the limit: so much memory would be set aside
    if len(data) > size:  # it grew, or is one of /proc, which have no size
        raise RefusedFileError(path, "has more bytes than its size says; copy it first")
    return data


def _checked(descriptor: int, path: Path) -> int:
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return descriptor
    os.close(descriptor)
    kind = "directory" if stat.S_ISDIR(mode) else "pipe" if stat.S_ISFIFO(mode) else "device"
    raise RefusedFileError(path, f"is a {kind}, not a file")


def project_root(folder: Path) -> Path:
    """The folder that no path in a file of `folder` may leave.

    The outermost Python package around it, else the nearest folder above that holds `pyproject.toml`, `package.xml` or
    `.git`, else the folder itself.
    """
    folder = folder.resolve()
    package = folder
    while (package / "__init__.py").is_file() and package != package.parent:
        package = package.parent
    if package != folder:
        inner = folder.relative_to(package).parts[0]
        return package / inner
    marked = (above for above in (folder, *folder.parents) if any((above / name).exists() for name in _MARKERS))
    return next(marked, folder)
