"""Worlds with fields for tests."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import anysim
from anysim.families.base import Family

ENGINES = ("mujoco", "pybullet", "sapien")
ALL = np.array([0])


def run_of(
    field: dict[str, Any], engine: str = "mujoco", world: dict[str, Any] | None = None, **physics: Any
) -> dict[str, Any]:
    """A run that only watches a world with the family `it`."""
    return {
        "engine": engine,
        "physics": {"dt": 0.004, "control_dt": 0.02, **physics},
        "world": {**(world or {}), "families": {"it": field}},
        "task": {"observations": {"policy": ["last_action"]}, "horizon": 1000},
    }


def balls(*places: tuple[float, float, float], radius: float = 0.02, mass: float = 0.1) -> dict[str, Any]:
    """A world with balls a, b, c…"""
    names = "abcdef"[: len(places)]
    return {
        "objects": {name: {"source": {"sphere": radius}, "mass": mass} for name in names},
        "layout": {name: {"position": [*place]} for name, place in zip(names, places, strict=True)},
    }


@contextmanager
def begun(run: dict[str, Any], num_envs: int = 1, seed: int = 0) -> Iterator[tuple[anysim.TaskEnv, Family]]:
    """An env of a run after its reset, and its field."""
    with anysim.make(run, num_envs=num_envs) as env:
        env.reset(seed=seed)
        assert env.families is not None
        yield env, env.families.family("it")


def wait(env: anysim.TaskEnv, steps: int = 1) -> None:
    """Go on without an action."""
    for _ in range(steps):
        env.step(np.zeros((env.num_envs, 0)))
