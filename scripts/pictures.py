"""Worlds without a task, as engines draw them: what the scripts that make the guides' pictures have in common."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from PIL import Image

import anysim

ENGINES = ("mujoco", "pybullet", "sapien")


@contextmanager
def begun(engine: str, world: dict[str, Any], *, dt: float = 0.004) -> Iterator[anysim.TaskEnv]:
    """An env of a world after its reset, with control steps of 20 ms."""
    run = {"engine": engine, "physics": {"dt": dt, "control_dt": 0.02}, "world": world}
    with anysim.make({**run, "task": {"observations": {"policy": ["last_action"]}, "horizon": 1000}}) as env:
        env.reset(seed=0)
        yield env


def side_by_side(world: dict[str, Any], camera: str, steps: int, *, dt: float = 0.004) -> Image.Image:
    """What a camera sees after control steps, on each engine."""
    images: list[Any] = []
    for engine in ENGINES:
        with begun(engine, world, dt=dt) as env:
            for _ in range(steps):
                env.step([[]])
            images.append(env.engine.render(camera)["rgb"][0])
    return Image.fromarray(np.concatenate(images, axis=1))
