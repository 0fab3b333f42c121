"""The fixtures of the contract suite: the engine under test, with worlds built on demand and freed afterwards."""

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any, Protocol

import pytest

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.executor import executor
from anysim.engine.requirements import needs_of
from anysim.model.world import World
from anysim.testing import plugin
from anysim.testing.engines import require_drawing
from anysim.testing.watch import watch

DRAWING = (Capability.RENDER_RGB, Capability.RENDER_DEPTH, Capability.RENDER_SEGMENTATION)


class Build(Protocol):
    """Builds a world on a new engine of the kind under test; skips the test where the engine cannot run the world."""

    def __call__(self, world: World, num_envs: int = 1) -> SimEngine: ...


@pytest.fixture(scope="session")
def engine_class(pytestconfig: pytest.Config) -> type[SimEngine]:
    """The class under test."""
    return plugin.engine_class(pytestconfig)


@pytest.fixture(scope="session", autouse=True)
def _workers(pytestconfig: pytest.Config) -> Iterator[None]:
    """An engine in worker processes is made for each test; its workers serve one after the other."""
    with executor().keeping() if pytestconfig.getoption("shards") else nullcontext():
        yield


@pytest.fixture
def new_engine(
    engine_class: type[SimEngine], pytestconfig: pytest.Config, request: pytest.FixtureRequest
) -> Iterator[Callable[[], SimEngine]]:
    """Makes engines without a world, with the options of the command line; all are destroyed after the test.

    All that is read of them is looked at, see `anysim.testing.watch`.
    """
    energy = request.node.get_closest_marker(plugin.OVERLAPS) is None
    options: dict[str, Any] = plugin.engine_options(pytestconfig)
    made: list[SimEngine] = []

    def make() -> SimEngine:
        made.append(engine_class(**options))
        watch(made[-1], energy)
        return made[-1]

    yield make
    for engine in made:
        engine.destroy()


@pytest.fixture
def build(new_engine: Callable[[], SimEngine], engine_class: type[SimEngine]) -> Build:
    """See Build."""

    def make(world: World, num_envs: int = 1) -> SimEngine:
        for need in needs_of(world):
            _skip_undeclared(engine_class, need.capability)
        engine = new_engine()
        if engine.refusals(world, engine.options):
            pytest.skip(f"{engine.name} refuses '{world.name}'")
        return engine.create_world(world, num_envs)

    return make


@pytest.fixture(autouse=True)
def _declared(request: pytest.FixtureRequest) -> None:
    """Skip a test whose `needs` marker names a capability that the engine does not declare."""
    for marker in request.node.iter_markers(plugin.NEEDS):
        for capability in marker.args:
            skip_without(request.getfixturevalue("engine_class"), capability)


def skip_without(engine_class: type[SimEngine], capability: Capability) -> None:
    """Skip the running test, naming the capability; one that draws also where this machine lacks what drawing needs."""
    _skip_undeclared(engine_class, capability)
    if capability in DRAWING:
        require_drawing(engine_class)


def _skip_undeclared(engine_class: type[SimEngine], capability: Capability) -> None:
    if capability not in engine_class.capabilities:
        pytest.skip(f"{engine_class.name} does not declare '{capability}'")


def needs(*capabilities: Capability) -> pytest.MarkDecorator:
    """Mark a test with the capabilities it needs beyond those of the worlds it builds."""
    return getattr(pytest.mark, plugin.NEEDS)(*capabilities)


def skip_without_parameter(engine_class: type[SimEngine], name: str) -> None:
    """Skip the running test where the engine cannot change the parameter."""
    skip_without(engine_class, Capability.PARAMETERS_PER_ENV)
    if name not in engine_class.parameters:
        pytest.skip(f"{engine_class.name} does not declare 'parameter {name}'")
