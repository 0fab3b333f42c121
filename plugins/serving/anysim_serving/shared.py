"""Images in memory shared with a client on the same machine; `anysim_client.shared` is its side."""

import hmac
import mmap
import os
import secrets
from collections.abc import Mapping
from typing import Any, Self

import numpy as np

from anysim.task.contract import Obs
from anysim.task.env import TaskEnv
from anysim_client.errors import MalformedFrame
from anysim_client.shared import MARK, PAGE, PROOF_BYTES, Layout, shared_folder
from anysim_serving.operations import image_kind

SLOTS = 4
_LEFT_FREE = 16 << 20
"""Bytes of memory that what is shared must leave free."""


def _layout(shapes: Mapping[str, tuple[int, ...]], num_envs: int) -> tuple[Layout, int]:
    """The layout of a slot and its size."""
    layout: Layout = {}
    place = 0
    for name, shape in shapes.items():
        kind = image_kind(name)
        layout[name] = (place, (num_envs, *shape), kind)
        place += -(-int(np.prod((num_envs, *shape))) * np.dtype(kind).itemsize // PAGE) * PAGE
    return layout, place


class Offer:
    """The service's side: memory for the images of one env, and the proof that a client is near."""

    def __init__(self, name: str, memory: mmap.mmap, layout: Layout, slot_bytes: int) -> None:
        self.name, self._memory, self._layout, self._slot_bytes = name, memory, layout, slot_bytes
        self._proof = secrets.token_bytes(PROOF_BYTES)
        memory[:PROOF_BYTES] = self._proof
        self._arrays = [
            {
                key: np.ndarray(shape, kind, memory, PAGE + slot * slot_bytes + place)
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
        size, path = PAGE + SLOTS * slot_bytes, shared_folder() / f"anysim-{secrets.token_hex(16)}"
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
            (shared_folder() / self.name).unlink(missing_ok=True)
            self.name = ""

    def close(self) -> None:
        """Give the memory back. May be called twice."""
        self._unlink()
        self._arrays.clear()
        self._memory.close()
