"""The planner `roboplan`: its scenes are those of `rrt`, and its search is roboplan's."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from anysim.errors import PluginError
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.motion import Attachment, Budget, PlanRequest, PlanStatus, Scene, Scenes, motion_planner
from anysim.testing.planners import rooms
from anysim_planning import roboplan_scene
from anysim_planning.roboplan_planner import RoboplanPlanner
from anysim_planning.rrt import RrtPlanner
from anysim_planning.threads import ThreadedService
from tests.plugins.planning.conftest import across

pytest.importorskip("roboplan.rrt", reason="roboplan is an extra")
HELD = Attachment("cube", "panda.panda_link7", np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0]))


def agreement(planner: RoboplanPlanner, request: PlanRequest, scene: Scene, count: int = 400) -> tuple[float, float]:
    """The parts of random configurations that both say to be free, and that roboplan says to be so wrongly."""
    world = planner.world_of(request, scene)
    other = planner._scene(world).scene
    names = [planner.world.joints[j].name for j in world.joints]
    columns = [names.index(name) for name in other.getJointNames()]
    rng = np.random.default_rng(0)
    rows = rng.uniform(world.lower, world.upper, (count, len(names)))
    ours = ~world.hits(rows)
    theirs = np.array([not other.hasCollisions(row[columns]) for row in rows])
    assert 0.1 < ours.mean() < 0.95
    return float((ours == theirs).mean()), float((theirs & ~ours).mean())


def test_round_things_and_boxes_are_the_same_to_both() -> None:
    world = rooms.one_arm()
    scene = Scenes(world, 1).scene(0)
    planner = RoboplanPlanner(world)
    request = rooms.across(world)
    assert agreement(planner, request, scene) == (1.0, 0.0)
    moved = scene.body_pose.copy()
    moved[-2:, 1] += 0.3  # the wall, which stands in the text, and the cube, which does not
    moved[:, 0] += 0.1
    assert agreement(planner, request, scene._replace(body_pose=moved)) == (1.0, 0.0)
    assert agreement(planner, request, scene) == (1.0, 0.0)
    turn = P.from_axis_angle(np.array([0.0, 0.6, 0.8]), np.array(0.7))
    for offset in (rooms.IN_HAND, np.array([0.1, -0.05, 0.25, *turn])):
        held = replace(request, attached=(Attachment("cube", rooms.HAND, offset),))
        assert agreement(planner, held, scene) == (1.0, 0.0)
    same, too_free = agreement(planner, replace(request, padding=0.03), scene)
    assert same > 0.97
    assert too_free == 0.0


def test_meshes_are_nearly_the_same_to_both(world: World, scene: Scene) -> None:
    planner = RoboplanPlanner(world)
    for request in (across(world), across(world, attached=(HELD,))):
        same, too_free = agreement(planner, request, scene)
        assert same >= 0.98
        assert too_free <= 0.01


def test_the_search_is_roboplans(world: World, scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RrtPlanner, "search", None)
    planner = motion_planner(world, "roboplan")
    moved = scene.body_pose.copy()
    moved[:, 2] += 0.05
    for request in [across(world, seed=s) for s in range(4)] + [across(world, attached=(HELD,))]:
        for here in (scene, scene._replace(body_pose=moved)):
            answer = planner.plan(request, here, Budget(request.deadline))
            assert answer.status is PlanStatus.OK, answer.message
            assert planner.is_free(request, here, answer.trajectory.joint_pos)
            assert np.ptp(answer.trajectory.joint_pos[:, 1]) > 0.1


def test_where_roboplan_cannot_begin_the_own_search_does(
    world: World, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It does not begin outside of the limits, where a robot may well be."""
    own, asked = RrtPlanner.search, []

    def search(self: RrtPlanner, request: PlanRequest, *more: object) -> np.ndarray | None:
        asked.append(request)
        return own(self, request, *more)

    monkeypatch.setattr(RrtPlanner, "search", search)
    lower = world.joints[1].lower
    start = np.array([0.8, lower - 0.001, 0.0, -2.0, 0.0, 2.4, 0.785])
    planner = motion_planner(world, "roboplan")
    request = replace(across(world), start=start)
    assert planner.plan(request, scene, Budget(request.deadline)).status is PlanStatus.OK
    assert request in asked


def test_the_answer_is_the_same_on_one_and_on_two_threads(world: World, scene: Scene) -> None:
    requests = [across(world, seed=s) for s in range(4)]
    found = []
    for threads in (1, 2):
        with ThreadedService(world, "roboplan", threads) as plans:
            futures = [plans.submit(request, scene) for request in requests[:: 1 if threads == 1 else -1]]
            answers = [future.result() for future in futures]
            found.append(answers if threads == 1 else answers[::-1])
    for a, b in zip(*found, strict=True):
        assert a.status is b.status is PlanStatus.OK
        assert np.array_equal(a.trajectory.joint_pos, b.trajectory.joint_pos)


def test_a_version_that_places_geometry_elsewhere_is_refused(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    core = roboplan_scene.roboplan_module("core")

    class Elsewhere(core.Scene):
        def updateGeometryPlacement(self, name: str, parent: str, tform: np.ndarray) -> None:
            super().updateGeometryPlacement(name, parent, np.asfortranarray(tform @ shifted()))

    fake = SimpleNamespace(**{**vars(core), "Scene": Elsewhere})
    monkeypatch.setattr(roboplan_scene, "roboplan_module", lambda _: fake)
    with pytest.raises(PluginError, match="does not have attached geometry where"):
        roboplan_scene.probe()


def shifted() -> np.ndarray:
    shift = np.eye(4)
    shift[2, 3] = 0.1
    return shift


def test_without_roboplan_the_remedy_is_told(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "roboplan.core", None)
    with pytest.raises(PluginError, match=r"pip install 'anysim-planning\[roboplan\]'"):
        motion_planner(world, "roboplan")
