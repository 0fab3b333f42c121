"""Images in memory that a service and a client on the same machine share.

The service makes a file in memory under a name that nobody can guess and that only its user can open, writes a number
into it, and tells the name. A client that finds the number there is on the same machine and of the same user, and says
so; the name is removed then, so nothing is left when both end, however they end.

The memory has several slots. With each message the client names one that is free, and gets arrays that lie in it: they
are the caller's own, and the slot is free again when the last of them is gone. Where none is free, images are sent.
"""

import contextlib
import ctypes
import mmap
import os
import re
import stat
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from anysim.conventions import Array

MARK = "shared"
_NAME = re.compile(r"anysim-[0-9a-f]{32}")
PROOF_BYTES = 32
PAGE = 4096
Layout = dict[str, tuple[int, tuple[int, ...], str]]
"""By name the place in a slot, the shape and the type of an array."""


def shared_folder() -> Path:
    """Where the memory has its name."""
    return Path("/dev/shm") if Path("/dev/shm").is_dir() else Path(tempfile.gettempdir())


class SharedSlots:
    """The client's side: slots, and which of them are free.

    Attributes:
        proof: what the service wrote there.
    """

    def __init__(self, memory: mmap.mmap, layout: Layout, slot_bytes: int, slots: int) -> None:
        self._memory, self._layout, self._slot_bytes = memory, layout, slot_bytes
        self._free = set(range(slots))
        self.proof = np.frombuffer(memory[:PROOF_BYTES], np.uint8)

    @classmethod
    def found(cls, terms: Mapping[str, Any]) -> "Self | None":
        """The memory that a service offered; None if it is not here.

        A service is not trusted with more than its own memory: the name has one form and one folder, and what is there
        must be a file of this user and of the stated size.
        """
        name = terms.get("name")
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            return None
        try:
            descriptor = os.open(shared_folder() / name, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
        except OSError:
            return None
        try:
            slot_bytes, slots = int(terms["slot_bytes"]), int(terms["slots"])
            layout = {
                str(key): (int(place), tuple(map(int, shape)), str(kind))
                for key, (place, shape, kind) in terms["layout"].items()
            }
            for place, shape, kind in layout.values():
                size = int(np.prod(shape)) * np.dtype(kind).itemsize
                if np.dtype(kind).kind not in "biuf" or min(shape) < 0 or not 0 <= place <= slot_bytes - size:
                    return None
            about, size = os.fstat(descriptor), PAGE + slots * slot_bytes
            if not stat.S_ISREG(about.st_mode) or about.st_uid != os.getuid() or about.st_size != size:
                return None
            return cls(mmap.mmap(descriptor, size), layout, slot_bytes, slots)
        except (ValueError, TypeError, KeyError, AttributeError, OSError):
            return None
        finally:
            os.close(descriptor)

    def slot(self) -> int | None:
        """The first slot that nobody reads any more, likely still in a cache; None if there is none."""
        first = min(self._free, default=None)
        self._free.discard(first)  # pyright: ignore[reportArgumentType]
        return first

    def release(self, slot: int) -> None:
        """The slot was not used."""
        self._free.add(slot)

    def arrays(self, slot: int) -> dict[str, Array]:
        """The images in a slot, which is free again when the last array, and whatever views it, is gone."""
        lease = (ctypes.c_char * self._slot_bytes).from_buffer(self._memory, PAGE + slot * self._slot_bytes)
        weakref.finalize(lease, self._free.add, slot).atexit = False
        return {
            name: np.frombuffer(memoryview(lease), kind, int(np.prod(shape)), place).reshape(shape)
            for name, (place, shape, kind) in self._layout.items()
        }

    def close(self) -> None:
        """Give the memory back, or leave that to the last array in it."""
        with contextlib.suppress(BufferError):
            self._memory.close()
