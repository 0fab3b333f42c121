"""Arrays in memory that the parent and its workers share.

The memory has no name: it is reached by a file descriptor that is handed from process to process, so nothing can stay
behind when they end, however they end.
"""

import mmap
import os
import tempfile
from collections.abc import Mapping

import numpy as np

from anysim.conventions import Array

Layout = Mapping[str, tuple[tuple[int, ...], str]]
"""Shape and dtype of each array by name."""

_ALIGNMENT = 64  # bytes of a cache line


class SharedArrays:
    """Arrays by name over one block of shared memory. What is handed out of an engine must be a copy of them."""

    def __init__(self, layout: Layout, descriptor: int | None = None) -> None:
        """New memory, or that of a descriptor which another process handed over; either way the descriptor is owned."""
        sizes = {name: int(np.prod(shape)) * np.dtype(kind).itemsize for name, (shape, kind) in layout.items()}
        total = max(1, sum(-(-size // _ALIGNMENT) * _ALIGNMENT for size in sizes.values()))
        self.layout = layout
        self.descriptor = _anonymous_file(total) if descriptor is None else descriptor
        self._map = mmap.mmap(self.descriptor, total)
        self._arrays: dict[str, Array] = {}
        start = 0
        for name, (shape, kind) in layout.items():
            self._arrays[name] = np.ndarray(shape, kind, self._map, start)
            start += -(-sizes[name] // _ALIGNMENT) * _ALIGNMENT

    def __getitem__(self, name: str) -> Array:
        return self._arrays[name]

    def close(self) -> None:
        """Give the memory back; views of it must be gone. May be called twice."""
        if self.descriptor >= 0:
            self._arrays.clear()
            self._map.close()
            os.close(self.descriptor)
            self.descriptor = -1


def _anonymous_file(size: int) -> int:
    if hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("anysim")
    else:
        with tempfile.TemporaryFile(prefix="anysim") as file:  # has no name either: it was removed when it was made
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, size)
    return descriptor
