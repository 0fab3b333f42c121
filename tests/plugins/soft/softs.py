"""Worlds with soft matter for tests."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import anysim
from anysim_soft.family import Soft

ENGINES = ("mujoco", "pybullet", "sapien")
ALL = np.array([0])


def run_of(
    matter: dict[str, Any], engine: str = "mujoco", world: dict[str, Any] | None = None, **physics: Any
) -> dict[str, Any]:
    """A run that only watches a world with the family `it`."""
    return {
        "engine": engine,
        "physics": {"dt": 0.004, "control_dt": 0.02, **physics},
        "world": {**(world or {}), "families": {"it": matter}},
        "task": {"observations": {"policy": ["last_action"]}, "horizon": 1000},
    }


def with_ball(place: list[float], radius: float = 0.05, mass: float = 0.5) -> dict[str, Any]:
    """A world with a ball."""
    return {"objects": {"ball": {"source": {"sphere": radius}, "mass": mass}}, "layout": {"ball": {"position": place}}}


@contextmanager
def begun(run: dict[str, Any], num_envs: int = 1, seed: int = 0) -> Iterator[tuple[anysim.TaskEnv, Soft]]:
    """An env of a run after its reset, and its matter."""
    with anysim.make(run, num_envs=num_envs) as env:
        env.reset(seed=seed)
        assert env.families is not None
        family = env.families.family("it")
        assert isinstance(family, Soft)
        yield env, family


def wait(env: anysim.TaskEnv, steps: int = 1) -> None:
    """Go on without an action."""
    for _ in range(steps):
        env.step(np.zeros((env.num_envs, 0)))
