"""The planner `rrt`: paths around things, goal sets, lines, held objects, and what it says when it cannot."""

from dataclasses import replace

import numpy as np
import pytest

from anysim.errors import AnysimError
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World
from anysim.planning.api import inverse_kinematics
from anysim.planning.motion import (
    Attachment,
    Budget,
    PlanAnswer,
    PlanRequest,
    PlanStatus,
    Scene,
    Scenes,
    ToolGoal,
    motion_planner,
)
from anysim.testing.planners import measure, rooms
from anysim_planning import goals, rrt
from anysim_planning.rrt import RrtPlanner
from anysim_planning.threads import ThreadedService
from tests.plugins.planning.conftest import LEFT, RIGHT, across, arm_joints, down, in_the_wall, reach


@pytest.fixture(scope="module")
def planner(world: World) -> RrtPlanner:
    made = motion_planner(world)
    assert isinstance(made, RrtPlanner)
    return made


def planned(planner: RrtPlanner, request: PlanRequest, scene: Scene) -> PlanAnswer:
    return planner.plan(request, scene, Budget(request.deadline))


def same(a: PlanAnswer, b: PlanAnswer) -> bool:
    return (a.status, a.chosen) == (b.status, b.chosen) and (
        a.trajectory is None or all(np.array_equal(x, y) for x, y in zip(a.trajectory, b.trajectory, strict=True))
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_it_goes_around_the_wall_within_all_limits(world: World, planner: RrtPlanner, scene: Scene, seed: int) -> None:
    request = across(world, seed=seed)
    assert in_the_wall(world, scene, np.linspace(LEFT, RIGHT, 100))
    answer = planned(planner, request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.trajectory is not None
    times, q, rate = answer.trajectory
    assert not in_the_wall(world, scene, q)
    np.testing.assert_array_equal(q[[0, -1]], [LEFT, RIGHT])
    assert not rate[[0, -1]].any()
    steps = np.diff(times)[:, None]
    limits = np.array([joint.velocity_limit for joint in world.joints[:7]])
    assert (np.abs(rate) <= limits * 1.001).all()
    assert (np.abs(np.diff(q, axis=0) / steps) <= limits * 1.001).all()
    assert (np.abs(np.diff(rate, axis=0) / steps) <= request.acceleration * 1.001).all()
    np.testing.assert_allclose(np.diff(q, axis=0), 0.5 * (rate[1:] + rate[:-1]) * steps, atol=2e-3)
    assert planner.is_free(request, scene, q)
    assert not planner.is_free(request, scene, np.stack([LEFT, RIGHT]))


def test_the_answer_is_the_same_alone_in_a_batch_and_on_two_threads(world: World, scene: Scene) -> None:
    poses = down((0.5, -0.3, 0.3), (0.4, -0.4, 0.3), (2.0, 0.0, 0.3))
    requests = [across(world, seed=s) for s in range(3)] + [reach(world, poses, seed=s) for s in range(3)]
    alone = [planned(RrtPlanner(world), request, scene) for request in requests]
    assert {answer.status for answer in alone} == {PlanStatus.OK}
    for threads in (1, 2):
        with ThreadedService(world, "rrt", threads) as plans:
            futures = [plans.submit(request, scene) for request in reversed(requests)]
            assert all(same(f.result(), a) for f, a in zip(futures, reversed(alone), strict=True))


def test_a_goal_set_says_of_each_candidate_what_became_of_it(world: World, planner: RrtPlanner, scene: Scene) -> None:
    poses = down((2.0, 0.0, 0.3), (0.5, 0.0, 0.3), (0.5, -0.3, 0.3))  # too far, inside the wall, behind it
    answer = planned(planner, reach(world, poses), scene)
    assert answer.goal_status == (PlanStatus.NO_IK, PlanStatus.NO_IK, PlanStatus.OK)
    assert answer.chosen == (2,)
    chain = Chain.from_world(world, "panda", "arm", "tool")
    base = scene.body_pose[chain.root]
    np.testing.assert_allclose(chain.tool_pose(base, answer.trajectory.joint_pos[-1])[:3], poses[2, :3], atol=2e-4)
    nothing = planned(planner, reach(world, poses[:2]), scene)
    assert nothing.status is PlanStatus.NO_IK
    assert "1 of 2 candidates can be reached, all of them in collision" in nothing.message


def test_a_tool_that_may_slide_is_anywhere_along_its_axis(world: World, planner: RrtPlanner, scene: Scene) -> None:
    """A pose out of reach along the tool's own axis, which is level; off the axis the tool has no freedom."""
    chain = Chain.from_world(world, "panda", "arm", "tool")
    quaternion = np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])  # z of the tool along x of the world
    far = np.array([[1.5, -0.4, 0.5, *quaternion]])
    request = reach(world, far)
    assert planned(planner, request, scene).status is PlanStatus.NO_IK
    for slide, status in ((1.0, PlanStatus.OK), (float("inf"), PlanStatus.OK), (0.3, PlanStatus.NO_IK)):
        goal = replace(request.goals[0], slide=(0.0, 0.0, slide))
        answer = planned(planner, replace(request, goals=(goal,)), scene)
        assert answer.status is status, answer.message
        if answer.trajectory is not None:
            tool = chain.tool_pose(scene.body_pose[chain.root], answer.trajectory.joint_pos[-1])
            np.testing.assert_allclose(tool[1:3], far[0, 1:3], atol=2e-4)
            assert P.angle_between(tool[3:], quaternion) < 2e-4
            assert far[0, 0] - slide - 1e-3 <= tool[0] < 0.8
    along_x = replace(request.goals[0], slide=(1.0, 0.0, 0.0))  # that is down in the world
    assert planned(planner, replace(request, goals=(along_x,)), scene).status is PlanStatus.NO_IK
    with pytest.raises(AnysimError, match="lengths >= 0"):
        replace(request, goals=(replace(goal, slide=(0.0, 0.0, -0.1)),)).check()


def test_a_base_that_stands_elsewhere_moves_the_goal_with_it(world: World, planner: RrtPlanner, scene: Scene) -> None:
    shift = np.zeros_like(scene.body_pose)
    shift[:, 0] = 0.3
    moved = scene._replace(body_pose=scene.body_pose + shift)
    here = planned(planner, reach(world, down((0.4, -0.4, 0.3))), scene)
    there = planned(planner, reach(world, down((0.7, -0.4, 0.3))), moved)
    np.testing.assert_allclose(here.trajectory.joint_pos[-1], there.trajectory.joint_pos[-1], atol=1e-6)


def test_a_straight_line_stays_within_its_deviation(world: World, planner: RrtPlanner, scene: Scene) -> None:
    chain = Chain.from_world(world, "panda", "arm", "tool")
    start = chain.tool_pose(scene.body_pose[chain.root], LEFT)
    end = start + np.array([-0.05, 0.05, 0.12, 0, 0, 0, 0])
    answer = planned(planner, reach(world, end[None], straight=0.001), scene)
    assert answer.status is PlanStatus.OK, answer.message
    path = answer.trajectory.joint_pos
    points = chain.tool_pose(np.tile(scene.body_pose[chain.root], (len(path), 1)), path)[:, :3] - start[:3]
    way = (end - start)[:3]
    away = points - (points @ way / (way @ way))[:, None] * way
    assert np.linalg.norm(away, axis=1).max() <= 0.0012
    through = down((0.5, -0.3, 0.3))
    assert planned(planner, reach(world, through, straight=0.001), scene).status is PlanStatus.NO_PATH


def test_a_held_object_collides_too(world: World, planner: RrtPlanner, scene: Scene) -> None:
    chain = Chain.from_world(world, "panda", "arm", "tool")
    goal = LEFT + np.array([-0.1, 0, 0, 0, 0, 0, 0])
    height = chain.tool_pose(scene.body_pose[chain.root], goal)[2]
    offset = np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0])
    held = Attachment("cube", "panda.panda_link7", offset)
    request = PlanRequest(arm_joints(world), LEFT, joint_goal=goal)
    assert planned(planner, request, scene).status is PlanStatus.OK
    assert planned(planner, replace(request, attached=(held,)), scene).status is PlanStatus.OK
    low = held._replace(offset=offset + np.array([0.0, 0.0, height, 0.0, 0.0, 0.0, 0.0]))  # in the ground
    sunk = planned(planner, replace(request, attached=(low,)), scene)
    assert sunk.status is PlanStatus.START_IN_COLLISION
    assert "'terrain' with 'cube.shape'" in sunk.message
    allowed = replace(request, attached=(low,), allowed=(("cube", "terrain"),))
    assert planned(planner, allowed, scene).status is PlanStatus.OK


@pytest.mark.parametrize("name", ["rrt", "roboplan"])
def test_a_held_object_may_leave_what_it_rests_on_but_not_enter_it(world: World, scene: Scene, name: str) -> None:
    if name == "roboplan":
        pytest.importorskip("roboplan.rrt", reason="roboplan is an extra")
    planner = motion_planner(world, name)
    chain = Chain.from_world(world, "panda", "arm", "tool")
    base = scene.body_pose[chain.root]
    start = reached(chain, base, down((0.45, -0.3, 0.05)))
    tool = chain.tool_pose(base, start)
    hand = link_pose(world, scene, start)
    held = [
        P.compose(P.inverse(hand), P.pose((*tool[:2], 0.02 - deep), (0.0, 0.0, 0.0, 1.0))) for deep in (4e-4, 0.004)
    ]
    resting, sunk = (Attachment("cube", "panda.panda_link7", offset) for offset in held)
    up = down((*tool[:2], 0.25))
    for padding in (0.0, 0.005):
        request = PlanRequest(
            arm_joints(world), start, (ToolGoal("panda", "tool", up),), attached=(resting,), padding=padding
        )
        answer = planned(planner, replace(request, allowed=(("panda", "terrain"),)), scene)
        assert answer.status is PlanStatus.OK, answer.message
        heights = cube_heights(world, scene, answer.trajectory.joint_pos, resting)
        assert heights.min() > 0.02 - 0.001
        assert heights[-1] > 0.2
    lower = replace(request, padding=0.0, goals=(ToolGoal("panda", "tool", down((*tool[:2], 0.045))),))
    lower = replace(lower, allowed=(("panda", "terrain"),))
    assert planned(planner, lower, scene).status is PlanStatus.NO_IK
    deep = replace(lower, attached=(sunk,), goals=request.goals)
    assert planned(planner, deep, scene).status is PlanStatus.START_IN_COLLISION
    assert planned(planner, replace(deep, attached=(resting,)), scene).status is PlanStatus.OK  # nothing is left over


def reached(chain: Chain, base: np.ndarray, pose: np.ndarray) -> np.ndarray:
    found = inverse_kinematics(chain).solve(
        pose, base[None], LEFT[None] * [-1, 1, 1, 1, 1, 1, 1], random_restarts=20, rng_seeds=np.zeros(1, np.uint64)
    )
    assert found.converged[0]
    return found.joint_pos[0]


def link_pose(world: World, scene: Scene, joint_pos: np.ndarray) -> np.ndarray:
    """World poses (..., 7) of the link that holds."""
    rows = np.atleast_2d(joint_pos)
    positions = np.tile([joint.initial for joint in world.joints], (len(rows), 1))
    positions[:, :7] = rows
    bodies = forward_kinematics(world, np.tile(scene.body_pose, (len(rows), 1, 1)), positions)
    poses = bodies[:, [body.name for body in world.bodies].index("panda.panda_link7")]
    return poses if joint_pos.ndim > 1 else poses[0]


def cube_heights(world: World, scene: Scene, path: np.ndarray, held: Attachment) -> np.ndarray:
    poses = link_pose(world, scene, path)
    return P.compose(poses, np.tile(held.offset, (len(path), 1)))[:, 2]


def test_padding_keeps_away_and_allowed_pairs_may_touch(world: World, planner: RrtPlanner, scene: Scene) -> None:
    assert planned(planner, across(world, padding=0.02), scene).status is PlanStatus.OK
    padded = planned(planner, across(world, padding=0.4), scene)
    assert padded.status is PlanStatus.START_IN_COLLISION
    assert "'terrain'" in padded.message
    through = planned(planner, across(world, allowed=(("panda", "wall"),)), scene)
    np.testing.assert_allclose(through.trajectory.joint_pos[:, 1:], np.tile(LEFT[1:], (len(through.trajectory[0]), 1)))


def test_what_is_not_there_is_not_in_the_way(world: World, planner: RrtPlanner, scene: Scene) -> None:
    present = scene.present.copy()
    present[world.entity_numbers["wall"]] = False
    assert planner.is_free(across(world), scene._replace(present=present), np.stack([LEFT, RIGHT]))


def test_scenes_age_when_things_move_and_not_when_robots_do(world: World) -> None:
    scenes = Scenes(world, 2)
    poses = np.tile(world.initial_body_pose, (2, 1, 1))
    names = [body.name for body in world.bodies]
    before = scenes.version.copy()
    poses[:, names.index("panda.panda_link3"), 0] += 0.2
    poses[0, names.index("cube"), 0] += 0.001
    scenes.update(poses)
    assert (scenes.version == before).all()
    poses[0, names.index("cube"), 0] += 0.0015  # together more than the tolerance
    scenes.update(poses)
    assert (scenes.version - before).tolist() == [1, 0]
    assert scenes.is_stale(0, PlanAnswer(PlanStatus.OK, world_version=int(before[0])))


def test_after_warming_up_there_is_nothing_to_build(
    world: World, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, request = RrtPlanner(world), reach(world, down((0.5, -0.3, 0.3)))
    made.warm_up(request, scene)
    monkeypatch.setattr(rrt, "PlanningWorld", None)
    monkeypatch.setattr(goals, "inverse_kinematics", None)
    assert planned(made, request, scene).status is PlanStatus.OK
    with pytest.raises(TypeError):  # as another set of joints needs new ones
        planned(made, replace(request, joints=request.joints[:6], start=LEFT[:6]), scene)


def test_cancelled_and_late_searches_end(world: World, planner: RrtPlanner, scene: Scene) -> None:
    budget = Budget(5.0)
    budget.cancel()
    assert planner.plan(across(world), scene, budget).status is PlanStatus.CANCELLED
    late = Budget(1e-9)
    late.begin()
    assert planner.plan(across(world), scene, late).status is PlanStatus.TIMEOUT


def test_unknown_names_are_told_with_those_that_exist(world: World, planner: RrtPlanner, scene: Scene) -> None:
    with pytest.raises(AnysimError, match=r"no joint 'panda\.elbow'"):
        planned(planner, PlanRequest(("panda.elbow",), np.zeros(1), joint_goal=np.ones(1)), scene)
    with pytest.raises(AnysimError, match=r"no body or entity 'wal'.*wall"):
        planned(planner, across(world, allowed=(("panda", "wal"),)), scene)
    with pytest.raises(AnysimError, match="'numba_ik' is no planner of motion"):
        motion_planner(world, "numba_ik")


@pytest.mark.slow
def test_two_robots_keep_the_padding_from_each_other() -> None:
    """Where they are nearer to each other than to anything else, by arithmetic of the suite."""
    room, rng, seen = rooms.two_arms(), np.random.default_rng(5), 0
    scene, planner = Scenes(room, 1).scene(0), motion_planner(room)
    lower, upper = (np.array([getattr(joint, end) for joint in room.joints]) for end in ("lower", "upper"))
    for _ in range(2000):
        q = rng.uniform(np.maximum(lower, -2.0), np.minimum(upper, 2.0))
        request = PlanRequest(rooms.joints(room), q, joint_goal=q, allowed=(("left", "left"), ("right", "right")))
        ground, between = measure.clearance(room, scene, request, q[None])
        if 0.02 < between < min(ground, 0.2) - 0.02:
            near = (between - 0.01, between + 0.01)
            assert [planner.is_free(replace(request, padding=d), scene, q[None]) for d in near] == [True, False]
            seen += 1
    assert seen > 10
