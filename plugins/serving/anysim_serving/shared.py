"""Images in memory that a service and a client on the same machine share.

The service makes a file in memory under a name that nobody can guess and that only its user can open, writes a number
into it, and tells the name. A client that finds the number there is on the same machine and of the same user, and says
so; the name is removed before the first image, so nothing is left when both end, however they end. From then on an
answer has the place of its images, and the client copies them before it asks again.
"""

import hmac
import os
import re
import secrets
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from anysim.conventions import Array
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim_processes.shared_memory import SharedArrays

MARK = "shared"
_NAME = re.compile(r"anysim-[0-9a-f]{32}")
_PROOF, _PROOF_BYTES = "proof", 32
_FREE_S = 16 << 20
"""Bytes of memory that stay free of what is shared."""


def _folder() -> Path:
    return Path("/dev/shm") if Path("/dev/shm").is_dir() else Path(tempfile.gettempdir())  # noqa: S108


class Shared:
    """Memory for the images of one env, on either side."""

    def __init__(self, name: str, arrays: SharedArrays) -> None:
        self.name, self._arrays = name, arrays
        self._proof = b""

    # ------------------------------------------------------------------ the service's side

    @classmethod
    def offer(cls, env: TaskEnv) -> "Self | None":
        """Memory for an env's images under a fresh name; None where it has none, or there is no room."""
        layout = {
            name: ((env.num_envs, *shape), kind) for name, (shape, kind) in _images(env.image_shapes).items()
        } | {_PROOF: ((_PROOF_BYTES,), "|u1")}
        size = sum(int(np.prod(shape)) * np.dtype(kind).itemsize for shape, kind in layout.values())
        if len(layout) == 1:
            return None
        name = f"anysim-{secrets.token_hex(16)}"
        path = _folder() / name
        try:
            space = os.statvfs(path.parent)
            if space.f_bavail * space.f_frsize < size + _FREE_S:
                return None
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), 0o600)
            try:
                os.ftruncate(descriptor, size + 64 * len(layout))
                shared = cls(name, SharedArrays(layout, descriptor))
            except BaseException:
                os.close(descriptor)
                path.unlink(missing_ok=True)
                raise
        except OSError:
            return None
        shared._proof = secrets.token_bytes(_PROOF_BYTES)
        shared._arrays[_PROOF][:] = np.frombuffer(shared._proof, np.uint8)
        return shared

    def terms(self) -> dict[str, Any]:
        """What the client has to know to find it."""
        layout = [[name, list(shape), kind] for name, (shape, kind) in self._arrays.layout.items()]
        return {"name": self.name, "layout": layout}

    def confirmed(self, proof: object) -> bool:
        """Whether the client found what was written there; the name is removed in any case."""
        self._unlink()
        given = proof.tobytes() if isinstance(proof, np.ndarray) else b""
        return bool(self._proof) and hmac.compare_digest(given, self._proof)

    def put(self, obs: Obs) -> dict[str, Any]:
        """Observations with their images moved here; rows of a part of the envs travel as they are."""
        answer: dict[str, Any] = {}
        for name, rows in obs.items():
            there = self._arrays[name] if name in self._arrays.layout and isinstance(rows, np.ndarray) else None
            if there is None or there.shape != rows.shape:
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
        self._arrays.close()

    # ------------------------------------------------------------------ the client's side

    @classmethod
    def open(cls, terms: Mapping[str, Any]) -> "tuple[Self, Array] | None":
        """The memory that a service offered, and what is written there; None if it is not here.

        A service is not trusted with more than its own memory: the name has one form and one folder, and what is there
        must be a file of this user and of the stated size.
        """
        name, layout = terms.get("name"), terms.get("layout")
        if not isinstance(name, str) or not _NAME.fullmatch(name) or not isinstance(layout, list):
            return None
        try:
            descriptor = os.open(_folder() / name, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
        except OSError:
            return None
        try:
            forms = {str(key): (tuple(map(int, shape)), str(kind)) for key, shape, kind in layout}
            size = sum(int(np.prod(shape)) * np.dtype(kind).itemsize for shape, kind in forms.values())
            about = os.fstat(descriptor)
            right = stat.S_ISREG(about.st_mode) and about.st_uid == os.getuid() and about.st_size >= size > 0
            if not right or any(np.dtype(kind).kind not in "biuf" for _, kind in forms.values()):
                raise ValueError
            shared = cls("", SharedArrays(forms, descriptor))
        except (ValueError, TypeError, OSError):
            os.close(descriptor)
            return None
        return shared, shared._arrays[_PROOF].copy()

    def take(self, name: str, into: Array | None = None) -> Array:
        """A copy of an array, in memory of its own or in `into`."""
        there = self._arrays[name]
        if into is None:
            return there.copy()
        np.copyto(into, there)
        return into


def _images(shapes: Mapping[str, tuple[int, ...]]) -> dict[str, tuple[tuple[int, ...], str]]:
    from anysim_serving.operations import image_kind

    return {name: (shape, image_kind(name)) for name, shape in shapes.items()}
