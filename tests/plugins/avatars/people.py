"""Runs with one avatar, and what is measured of them."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

import anysim
from anysim.conventions import Array
from anysim.task.env import TaskEnv
from anysim_avatars.bodies import BONES
from anysim_avatars.family import Avatars


def run_of(do: list[Any], engine: str = "null", **more: Any) -> dict[str, Any]:
    """A run with an avatar called ann; `world` and other keys of the avatar are added."""
    world = more.pop("world", {})
    return {
        "engine": engine,
        "num_envs": more.pop("num_envs", 1),
        "physics": {"dt": more.pop("dt", 0.004), "control_dt": 0.02},
        "world": {**world, "families": {"ann": {"kind": "avatar", "do": do, **more}}},
        "task": {"observations": {"policy": ["last_action"]}, "horizon": 3000},
    }


def avatars(env: TaskEnv, name: str = "ann") -> Avatars:
    assert env.families is not None
    family = env.families.family(name)
    assert isinstance(family, Avatars)
    return family


def wait(env: TaskEnv) -> None:
    env.step(np.zeros((env.num_envs, env.action_dim)))


def lived(run: Mapping[str, Any], steps: int, seed: int = 0) -> Iterator[tuple[TaskEnv, Avatars]]:
    """The env after each control step."""
    with anysim.make(run) as env:
        env.reset(seed=seed)
        for _ in range(steps):
            wait(env)
            yield env, avatars(env)


@contextmanager
def after(run: Mapping[str, Any], steps: int, seed: int = 0) -> Iterator[tuple[TaskEnv, Avatars]]:
    """The env after so many control steps, while it is open."""
    with anysim.make(run) as env:
        env.reset(seed=seed)
        for _ in range(steps):
            wait(env)
        yield env, avatars(env)


def joints(family: Avatars) -> dict[str, Array]:
    """The beginning of each bone (3,) of the first avatar in env 0."""
    return dict(zip(BONES, family.state(np.array([0])).points[0, : len(BONES)], strict=True))
