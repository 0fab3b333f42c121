"""Worlds with matter for tests: a tank on the ground, and what stands or floats in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import anysim
from anysim_particles.bench import tank
from anysim_particles.family import Particles

ENGINES = ("mujoco", "pybullet", "sapien")


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


def in_tank(edge: float, height: float, **things: tuple[dict[str, Any], list[float]]) -> dict[str, Any]:
    """A world with a tank, and objects at places."""
    world = tank(edge, height)
    for name, (thing, place) in things.items():
        world["objects"][name] = thing
        world["layout"][name] = {"position": place}
    return world


@contextmanager
def begun(run: dict[str, Any], num_envs: int = 1, seed: int = 0) -> Iterator[tuple[anysim.TaskEnv, Particles]]:
    """An env of a run after its reset, and its matter."""
    with anysim.make(run, num_envs=num_envs) as env:
        env.reset(seed=seed)
        assert env.families is not None
        family = env.families.family("it")
        assert isinstance(family, Particles)
        yield env, family


def wait(env: anysim.TaskEnv, steps: int = 1) -> None:
    """Go on without an action."""
    for _ in range(steps):
        env.step(np.zeros((env.num_envs, 0)))
