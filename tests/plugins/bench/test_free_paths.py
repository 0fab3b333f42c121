"""The benchmark's own check of paths, and requests that have an answer."""

import numpy as np
import pytest

from anysim import compile_world
from anysim.errors import EngineError
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World
from anysim.planning.motion import Scenes, motion_planner
from anysim_bench.free_paths import Touching, dense
from anysim_bench.plan_requests import Arms
from tests.plugins.planning.conftest import LEFT, RIGHT, ROOM


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    path = tmp_path_factory.mktemp("bench") / "room.yaml"
    path.write_text(ROOM)
    return compile_world(path)


def poses(world: World, path: np.ndarray) -> np.ndarray:
    positions = np.tile([joint.initial for joint in world.joints], (len(path), 1))
    positions[:, :7] = path
    return forward_kinematics(world, np.tile(world.initial_body_pose, (len(path), 1, 1)), positions)


def test_a_path_through_the_wall_touches_and_others_do_not(world: World) -> None:
    touching = Touching(world)
    through = dense(np.stack([LEFT, RIGHT]))
    assert np.abs(np.diff(through, axis=0)).max() <= 0.005 + 1e-9
    assert touching.any(poses(world, through))
    assert not touching.any(poses(world, dense(np.stack([LEFT, LEFT + 0.1]))))


def test_it_agrees_with_the_planner_on_drawn_configurations(world: World) -> None:
    planner, touching = motion_planner(world), Touching(world)
    scene, rng = Scenes(world, 1).scene(0), np.random.default_rng(3)
    request = Arms(world, planner, 1).requests(scene, np.zeros(len(world.joints)), 1, 1)[0]
    low, high = (np.array([getattr(joint, name) for joint in world.joints[:7]]) for name in ("lower", "upper"))
    found = [
        (planner.is_free(request, scene, q[None]), not touching.any(poses(world, np.stack([LEFT, q]))))
        for q in rng.uniform(low, high, (60, 7))
    ]
    assert {free for free, _ in found} == {True, False}
    assert all(one == other for one, other in found)


def test_a_robot_without_two_arms_has_no_pairs(world: World) -> None:
    with pytest.raises(EngineError, match="no 2 tools"):
        Arms(world, motion_planner(world), 2)
