"""Fixtures of the tests of the SAPIEN backend."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.model.world import World


@pytest.fixture
def make() -> Iterator[Callable[..., SimEngine]]:
    """`make(world, num_envs, **options)`: an engine that is destroyed after the test."""
    engines: list[SimEngine] = []

    def build(world: World, num_envs: int = 1, engine: str = "sapien", **options: Any) -> SimEngine:
        engines.append(create_simulation(engine, **options).create_world(world, num_envs))
        return engines[-1]

    yield build
    for engine in engines:
        engine.destroy()
