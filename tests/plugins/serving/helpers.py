"""A service for tests, on a thread, with a token; and what is compared of two envs."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

import anysim
from anysim_client.env import RemoteEnv
from anysim_serving.server import Service, fresh_token, serving
from anysim_serving.settings import Limits, Settings
from tests.task.helpers import BLIND, BLOCKS

ARM: dict[str, Any] = {"extends": "task:pick_cube", "engine": "null"}
SEEN: dict[str, Any] = {
    "engine": "mujoco",
    "world": {
        "name": "seen",
        "objects": {"red": {"source": {"box": [0.05, 0.05, 0.05]}, "mass": 0.2, "color": "red"}},
        "layout": {"red": {"position": [0.0, 0.0, 0.1], "yaw": {"range": [-3.0, 3.0]}}},
        "cameras": {"eye": {"from": [0.4, 0.4, 0.4], "look_at": "red", "size": [32, 24], "channels": ["rgb", "depth"]}},
    },
    "task": {
        "horizon": 8,
        "observations": {"policy": [{"term": "frame_pose", "frame": "red"}]},
        "images": {"eye": {"channels": ["rgb", "depth"]}},
    },
}
"""A cube that a camera sees."""


@contextmanager
def service(*sources: Any, limits: Limits | None = None, **options: Any) -> Iterator[Service]:
    """The blocks, and what else is given."""
    settings = Settings(token=fresh_token(), limits=limits or Limits(linger_s=0.2))
    with serving(*(sources or (BLOCKS,)), settings=settings, **options) as made:
        yield made


def connected(made: Service, **options: Any) -> RemoteEnv:
    """An env of it."""
    return anysim.connect(made.address, token=made.settings.token, **options)  # type: ignore[return-value]


def local(task: Any = BLOCKS, **options: Any) -> Any:
    """The same env without a service."""
    return anysim.make(task, **options)


def same(a: Any, b: Any) -> bool:
    """Equal in type, shape and every bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    return type(a) is type(b) and a == b


__all__ = ["ARM", "BLIND", "BLOCKS", "SEEN", "connected", "local", "replace", "same", "service"]
