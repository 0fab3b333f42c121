"""Envs that the tests of the runtime share, since building them takes longer than the tests."""

from collections.abc import Callable, Iterator

import pytest

from anysim.task.env import TaskEnv
from tests.runtime import light
from tests.runtime.model import Alone

Get = Callable[..., TaskEnv]


@pytest.fixture(scope="module")
def get() -> Iterator[Get]:
    """`get("mujoco", 3, "slide")`: an env, kept for the module. Whatever was done to it, a reset makes it new."""
    made: dict[tuple[str, int, str, int], TaskEnv] = {}

    def one(engine: str, num_envs: int, spec: str = "slide", shards: int = 1) -> TaskEnv:
        key = (engine, num_envs, spec, shards)
        if key not in made:
            made[key] = light.make(engine, num_envs, light.SPECS[spec], shards=shards)
        return made[key]

    yield one
    for env in made.values():
        env.close()


@pytest.fixture(scope="module")
def alone() -> Iterator[Callable[..., Alone]]:
    """`alone("mujoco", "slide")`: episodes of an env that is alone."""
    made: dict[tuple[str, str], Alone] = {}

    def one(engine: str, spec: str = "slide") -> Alone:
        if (engine, spec) not in made:
            made[engine, spec] = Alone(light.make(engine, 1, light.SPECS[spec]))
        return made[engine, spec]

    yield one
    for one_alone in made.values():
        one_alone.env.close()
