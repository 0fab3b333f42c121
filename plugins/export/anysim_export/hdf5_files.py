"""HDF5 files on disks that may be full: HDF5 1.14 ends the process where its last writes fail."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class _QuietFile(io.FileIO):
    """A file that keeps the first error of a write to itself, so that HDF5 can close, and tells it afterwards."""

    error: OSError | None = None

    def write(self, data: Any, /) -> int:
        size, view = len(data), memoryview(data).cast("B")
        try:
            while view and self.error is None:
                view = view[super().write(view) :]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None, /) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def check(self) -> None:
        """Raise what was kept."""
        if self.error is not None:
            raise OSError(self.error.errno, self.error.strerror, self.name)


@contextmanager
def new_file(path: Path) -> Iterator[tuple[Any, Any]]:
    """A new HDF5 file, and a function to call now and then, which raises OSError where a write failed before.

    Raises:
        OSError: a write failed, at the latest when the file is closed.
    """
    import h5py  # pyright: ignore[reportMissingImports]

    with _QuietFile(path, "w+") as disk:
        try:
            with h5py.File(disk, "w") as file:
                yield file, disk.check
        except Exception:
            disk.check()  # what HDF5 says of its own missing bytes says less
            raise
        disk.check()
