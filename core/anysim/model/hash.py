"""The hash of a World, equal across processes and machines, and the rounding of what enters one.

Numbers enter with ten significant digits, so that a last-bit difference between two machines' arithmetic does not
change the hash; meshes enter by the hash of their source and processing, not by their vertices, and textures
by the hash of their pixels.
"""

import dataclasses
import hashlib
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.parts import Mimic
from anysim.model.world import Mesh, Quat, Texture, Vec3, World

FORMAT = "anysim-world-1"


def _feed(digest: Any, value: Any) -> None:
    if isinstance(value, Mesh):
        _feed(digest, ("mesh", value.name, value.hash))
    elif isinstance(value, Texture):
        _feed(digest, ("texture", value.name, value.repeat, value.hash))
    elif isinstance(value, Enum):
        _feed(digest, value.value)
    elif dataclasses.is_dataclass(value):
        digest.update(f"<{type(value).__name__}".encode())
        for field in dataclasses.fields(value):
            if field.metadata.get("hashed") == "never":
                continue
            if field.metadata.get("hashed") == "if given" and getattr(value, field.name) == field.default:
                continue
            digest.update(f"|{field.name}=".encode())
            _feed(digest, getattr(value, field.name))
        digest.update(b">")
    elif isinstance(value, Mimic) and not value.curve:  # as before there were curves
        _feed(digest, value[:3])
    elif isinstance(value, bool) or value is None or isinstance(value, int | str):
        digest.update(f"{type(value).__name__}:{value};".encode())
    elif isinstance(value, float):
        digest.update(f"f:{value + 0.0:.10g};".encode() if abs(value) > 1e-300 else b"f:0;")
    elif isinstance(value, np.ndarray):
        digest.update(f"array{value.shape}".encode())
        for item in value.reshape(-1).tolist():
            _feed(digest, item)
    elif isinstance(value, Mapping):
        for key in sorted(value):
            _feed(digest, (key, value[key]))
    elif isinstance(value, frozenset):
        _feed(digest, tuple(sorted(value)))
    elif isinstance(value, tuple | list):
        digest.update(f"({len(value)}:".encode())
        for item in value:
            _feed(digest, item)
        digest.update(b")")
    else:
        raise TypeError(f"a World cannot hold a {type(value).__name__}")


def world_hash(world: World) -> str:
    """SHA-256 of everything in the World, in hexadecimal."""
    digest = hashlib.sha256(FORMAT.encode())
    _feed(digest, world)
    return digest.hexdigest()


def tidy(vector: Array) -> Vec3:
    """Three numbers rounded to 1e-12 (a picometre), without negative zeros."""
    x, y, z = (round(float(v), 12) + 0.0 for v in vector)
    return (x, y, z)


def split(pose: Array) -> tuple[Vec3, Quat]:
    """Position and quaternion of a pose (7,), rounded to 1e-12 and 1e-14."""
    x, y, z, w = (round(float(v), 14) + 0.0 for v in pose[3:])
    return tidy(pose[:3]), (x, y, z, w)
