"""The fixtures of the planners' suite: the planner under test, in two worlds."""

from collections.abc import Callable

import pytest

from anysim.model.world import World
from anysim.planning.motion import Budget, MotionPlanner, PlanAnswer, PlanRequest, Scene, Scenes
from anysim.testing import plugin
from anysim.testing.planners import rooms

Plan = Callable[[PlanRequest, Scene], PlanAnswer]
LATE = 0.5
"""[s] that a planner may take to look at its clock; a service gives one up that takes longer."""


@pytest.fixture(scope="session")
def make_planner(pytestconfig: pytest.Config) -> Callable[[World], MotionPlanner]:
    """Makes planners of the kind under test."""
    return plugin.planner_class(pytestconfig)


@pytest.fixture(scope="session")
def world() -> World:
    """See `rooms.one_arm`."""
    return rooms.one_arm()


@pytest.fixture(scope="session")
def scene(world: World) -> Scene:
    """The first one, as the world is made."""
    return Scenes(world, 1).scene(0)


@pytest.fixture(scope="session")
def planner(make_planner: Callable[[World], MotionPlanner], world: World) -> MotionPlanner:
    """One planner for many requests, as in a service."""
    return make_planner(world)


@pytest.fixture(scope="session")
def plan(planner: MotionPlanner) -> Plan:
    """Plans with a clock of its own for each request."""
    return lambda request, scene: planned(planner, request, scene)


@pytest.fixture(scope="session")
def pair(make_planner: Callable[[World], MotionPlanner]) -> tuple[World, Scene, MotionPlanner]:
    """See `rooms.two_arms`."""
    two = rooms.two_arms()
    return two, Scenes(two, 1).scene(0), make_planner(two)


@pytest.fixture(autouse=True)
def _claimed(request: pytest.FixtureRequest) -> None:
    """Skip a test of what the planner does not claim."""
    claimed = request.getfixturevalue("make_planner").capabilities
    for marker in request.node.iter_markers(plugin.CLAIMS):
        for capability in marker.args:
            if capability not in claimed:
                pytest.skip(f"the planner does not declare '{capability}'")


def planned(planner: MotionPlanner, request: PlanRequest, scene: Scene) -> PlanAnswer:
    """An answer, under the request's own deadline."""
    budget = Budget(request.deadline)
    budget.begin()
    return planner.plan(request, scene, budget)


def claims(*capabilities: str) -> pytest.MarkDecorator:
    """Mark a test with the capabilities of a planner that it is about."""
    return getattr(pytest.mark, plugin.CLAIMS)(*capabilities)
