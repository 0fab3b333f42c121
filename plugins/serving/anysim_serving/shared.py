"""Images in memory that a service and a client on the same machine share.

The service makes a file in memory under a name that nobody can guess and that only its user can open, writes a number
into it, and tells the name. A client that finds the number there is on the same machine and of the same user, and says
so; the name is removed then, so nothing is left when both end, however they end.

The memory has several slots. With each message the client names one that is free, and gets arrays that lie in it: they
are the caller's own, and the slot is free again when the last of them is gone. Where none is free, images are sent.
"""

import contextlib
import ctypes
import hmac
import mmap
import os
import re
import secrets
import stat
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from anysim.conventions import Array
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim_serving.errors import MalformedFrame
from anysim_serving.operations import image_kind

MARK = "shared"
SLOTS = 4
_NAME = re.compile(r"anysim-[0-9a-f]{32}")
_PROOF_BYTES = 32
_PAGE = 4096
_LEFT_FREE = 16 << 20
"""Bytes of memory that what is shared must leave free."""
Layout = dict[str, tuple[int, tuple[int, ...], str]]
"""By name the place in a slot, the shape and the type of an array."""


def _folder() -> Path:
    return Path("/dev/shm") if Path("/dev/shm").is_dir() else Path(tempfile.gettempdir())  # noqa: S108


def _layout(shapes: Mapping[str, tuple[int, ...]], num_envs: int) -> tuple[Layout, int]:
    """The layout of a slot and its size."""
    layout: Layout = {}
    place = 0
    for name, shape in shapes.items():
        kind = image_kind(name)
        layout[name] = (place, (num_envs, *shape), kind)
        place += -(-int(np.prod((num_envs, *shape))) * np.dtype(kind).itemsize // _PAGE) * _PAGE
    return layout, place


class Offer:
    """The service's side: memory for the images of one env, and the proof that a client is near."""

    def __init__(self, name: str, memory: mmap.mmap, layout: Layout, slot_bytes: int) -> None:
        self.name, self._memory, self._layout, self._slot_bytes = name, memory, layout, slot_bytes
        self._proof = secrets.token_bytes(_PROOF_BYTES)
        memory[:_PROOF_BYTES] = self._proof
        self._arrays = [
            {
                key: np.ndarray(shape, kind, memory, _PAGE + slot * slot_bytes + place)
                for key, (place, shape, kind) in layout.items()
            }
            for slot in range(SLOTS)
        ]

    @classmethod
    def of(cls, env: TaskEnv) -> "Self | None":
        """Memory for an env's images under a fresh name; None where it has none, or there is no room."""
        layout, slot_bytes = _layout(env.image_shapes, env.num_envs)
        if not layout:
            return None
        size, path = _PAGE + SLOTS * slot_bytes, _folder() / f"anysim-{secrets.token_hex(16)}"
        try:
            space = os.statvfs(path.parent)
            if space.f_bavail * space.f_frsize < size + _LEFT_FREE:
                return None
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), 0o600)
            try:
                os.ftruncate(descriptor, size)
                return cls(path.name, mmap.mmap(descriptor, size), layout, slot_bytes)
            except BaseException:
                path.unlink(missing_ok=True)
                raise
            finally:
                os.close(descriptor)
        except OSError:
            return None

    def terms(self) -> dict[str, Any]:
        """What the client has to know to find it."""
        layout = {name: [place, list(shape), kind] for name, (place, shape, kind) in self._layout.items()}
        return {"name": self.name, "layout": layout, "slot_bytes": self._slot_bytes, "slots": SLOTS}

    def confirmed(self, proof: object) -> bool:
        """Whether the client found what was written there; the name is removed in any case."""
        self._unlink()
        given = proof.tobytes() if isinstance(proof, np.ndarray) else b""
        return hmac.compare_digest(given, self._proof)

    def put(self, obs: Obs, slot: object) -> dict[str, Any]:
        """Observations with their images moved to a slot; rows of a part of the envs travel as they are."""
        if type(slot) is not int or not 0 <= slot < SLOTS:
            raise MalformedFrame(f"slots of the shared memory are 0 to {SLOTS - 1}")
        answer: dict[str, Any] = {}
        for name, rows in obs.items():
            there = self._arrays[slot].get(name)
            if there is None or not isinstance(rows, np.ndarray) or there.shape != rows.shape:
                answer[name] = rows
            else:
                np.copyto(there, rows)
                answer[name] = {MARK: name}
        return answer

    def _unlink(self) -> None:
        if self.name:
            (_folder() / self.name).unlink(missing_ok=True)
            self.name = ""

    def close(self) -> None:
        """Give the memory back. May be called twice."""
        self._unlink()
        self._arrays.clear()
        self._memory.close()


class Shared:
    """The client's side: slots, and which of them are free.

    Attributes:
        proof: what the service wrote there.
    """

    def __init__(self, memory: mmap.mmap, layout: Layout, slot_bytes: int, slots: int) -> None:
        self._memory, self._layout, self._slot_bytes = memory, layout, slot_bytes
        self._free = set(range(slots))
        self.proof = np.frombuffer(memory[:_PROOF_BYTES], np.uint8)

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
            descriptor = os.open(_folder() / name, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
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
            about, size = os.fstat(descriptor), _PAGE + slots * slot_bytes
            if not stat.S_ISREG(about.st_mode) or about.st_uid != os.getuid() or about.st_size != size:
                return None
            return cls(mmap.mmap(descriptor, size), layout, slot_bytes, slots)
        except (ValueError, TypeError, KeyError, AttributeError, OSError):
            return None
        finally:
            os.close(descriptor)

    def slot(self) -> int | None:
        """A slot that nobody reads any more; None if there is none."""
        return self._free.pop() if self._free else None

    def release(self, slot: int) -> None:
        """The slot was not used."""
        self._free.add(slot)

    def arrays(self, slot: int) -> dict[str, Array]:
        """The images in a slot, which is free again when the last array, and whatever views it, is gone."""
        lease = (ctypes.c_char * self._slot_bytes).from_buffer(self._memory, _PAGE + slot * self._slot_bytes)
        weakref.finalize(lease, self._free.add, slot).atexit = False
        return {
            name: np.frombuffer(lease, kind, int(np.prod(shape)), place).reshape(shape)
            for name, (place, shape, kind) in self._layout.items()
        }

    def close(self) -> None:
        """Give the memory back, or leave that to the last array in it."""
        with contextlib.suppress(BufferError):
            self._memory.close()
