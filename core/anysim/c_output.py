"""Engines in C and C++ write to the process's standard output and error. Here their words are caught instead.

File descriptors 1 and 2 belong to the process: while words are caught, those of other threads are caught too. So this
is for calls that are known to print, and no longer than they last.
"""

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

_LOCK = RLock()
_LIBC = ctypes.CDLL(None)


class Words:
    """What was said. `text` is complete when the block is left."""

    text = ""

    def after(self, message: object) -> str:
        """A message with the last of what was said, if anything was."""
        return f"{message}; {self.tail}" if self.text.strip() else str(message)

    @property
    def tail(self) -> str:
        """The last lines in one, for an error message; a remark where nothing was said."""
        lines = [line.strip() for line in self.text.splitlines() if line.strip()]
        return "; ".join(lines[-3:])[-400:] if lines else "it gave no reason"


@contextmanager
def quiet() -> Iterator[Words]:
    """Catch what C code writes to the standard output and error of the process within the block."""
    words = Words()
    with _LOCK, tempfile.TemporaryFile() as file:
        _flush()
        kept = os.dup(1), os.dup(2)
        try:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
            yield words
        finally:
            _flush()
            for saved, number in zip(kept, (1, 2), strict=True):
                os.dup2(saved, number)
                os.close(saved)
            file.seek(0)
            words.text = file.read().decode("utf-8", "replace")


def _flush() -> None:
    """Bring what is buffered to where it was meant to go."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and not stream.closed:
            stream.flush()
    _LIBC.fflush(None)
