"""Motions of one arm to joint positions: free, within limits, and honest where there is none."""

from dataclasses import replace
from time import perf_counter

import numpy as np
import pytest

from anysim.errors import AnysimError
from anysim.model.forward_kinematics import forward_kinematics
from anysim.planning.motion import PlanRequest, PlanStatus
from anysim.testing.planners import measure, rooms
from anysim.testing.planners.fixtures import LATE, claims

pytestmark = claims("joint_goal")
TOUCH = -0.001
"""[m] of penetration that shapes of other libraries may come to."""


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_way_around_a_wall(world, scene, plan, seed):
    """A path goes around what is in the way, begins at the start, ends at the goal and touches nothing between them."""
    request = rooms.across(world, seed=seed)
    assert measure.clearance(world, scene, request, np.stack([rooms.LEFT, rooms.RIGHT]))[0] < -0.02
    answer = plan(request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    path = answer.trajectory.joint_pos
    np.testing.assert_allclose(path[[0, -1]], [rooms.LEFT, rooms.RIGHT], atol=1e-6)
    assert min(measure.clearance(world, scene, request, path)) >= TOUCH


@pytest.mark.parametrize(("scale", "acceleration"), [(1.0, 10.0), (0.4, 2.0)])
def test_limits_of_joints_are_kept(world, scene, plan, scale, acceleration):
    """Positions, velocities and accelerations stay within the limits of the joints and of the request, at rest at ends.

    Velocities are the rates of the positions.
    """
    request = rooms.across(world, velocity_scale=scale, acceleration=acceleration)
    answer = plan(request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert measure.breaks(world, request, answer.trajectory) == []


def test_no_way_at_all(world, scene, plan):
    """Where the joints that may move leave no way past the wall the answer is `no_path`, or `timeout` at its time."""
    posed = scene._replace(body_pose=forward_kinematics(world, scene.body_pose[None], rooms.LEFT[None])[0])
    request = PlanRequest(rooms.joints(world)[:1], rooms.LEFT[:1], joint_goal=rooms.RIGHT[:1], deadline=rooms.LONG)
    answer = plan(request, posed)
    assert answer.status is PlanStatus.NO_PATH
    assert answer.trajectory is None
    assert answer.message
    begun = perf_counter()
    short = plan(replace(request, deadline=0.05), posed)
    assert perf_counter() - begun < 0.05 + LATE
    assert short.status in {PlanStatus.NO_PATH, PlanStatus.TIMEOUT}


def test_a_start_inside_of_something(world, scene, plan):
    """A start that collides is `start_in_collision`, whatever the goal."""
    inside = 0.5 * (rooms.LEFT + rooms.RIGHT)
    request = replace(rooms.across(world), start=inside)
    assert plan(request, scene).status is PlanStatus.START_IN_COLLISION


def test_a_goal_inside_of_something(world, scene, plan):
    """Joint positions that collide, or are beyond a limit, are no goal: `no_ik`."""
    inside = 0.5 * (rooms.LEFT + rooms.RIGHT)
    assert plan(replace(rooms.across(world), joint_goal=inside), scene).status is PlanStatus.NO_IK
    beyond = rooms.LEFT + np.array([3.0, 0, 0, 0, 0, 0, 0])
    assert plan(replace(rooms.across(world), joint_goal=beyond), scene).status is PlanStatus.NO_IK


def test_padding_is_kept(world, scene, plan):
    """A padded path keeps its distance from all that is no robot; a start without that distance is in collision."""
    request = rooms.across(world, padding=0.03)
    answer = plan(request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert measure.clearance(world, scene, request, answer.trajectory.joint_pos)[0] >= 0.03 + TOUCH
    assert plan(rooms.across(world, padding=0.4), scene).status is PlanStatus.START_IN_COLLISION


def test_allowed_pairs_may_touch(world, scene, plan):
    """Names of bodies or entities that may touch do so, and all others are still in the way."""
    inside = 0.5 * (rooms.LEFT + rooms.RIGHT)
    for names in (("arm", "wall"), ("wall", "arm")):
        into = replace(rooms.across(world, allowed=(names,)), joint_goal=inside)
        assert plan(into, scene).status is PlanStatus.OK
    request = replace(rooms.across(world, allowed=(("arm.link4", "wall"),)), joint_goal=inside)
    assert plan(request, scene).status is PlanStatus.NO_IK


def test_what_is_not_there(world, scene, planner):
    """An entity that is absent from the scene is not in the way, and one that has moved is where it is now."""
    straight = np.stack([rooms.LEFT, rooms.RIGHT])
    request = rooms.across(world)
    assert not planner.is_free(request, scene, straight)
    present = scene.present.copy()
    present[world.entity_numbers["wall"]] = False
    assert planner.is_free(request, scene._replace(present=present), straight)
    moved = scene.body_pose.copy()
    moved[[body.name for body in world.bodies].index("wall"), 0] += 3.0
    assert planner.is_free(request, scene._replace(body_pose=moved), straight)
    assert not planner.is_free(request, scene, straight)


def test_a_free_thing_in_the_way(world, scene, planner, plan):
    """A free object collides where the scene has it."""
    tool = rooms.tool_pose(world, scene, rooms.LEFT)
    there = scene.body_pose.copy()
    there[-1, :3] = tool[:3] + 0.08 * np.array([0.0, 0.0, 1.0])  # in the hand's shape
    request = rooms.across(world)
    assert plan(request, scene._replace(body_pose=there)).status is PlanStatus.START_IN_COLLISION
    assert planner.is_free(request, scene, rooms.LEFT[None])


def test_unknown_names(world, scene, plan):
    """A request with a joint or a pair that the world does not have is refused by an AnysimError."""
    with pytest.raises(AnysimError):
        plan(PlanRequest(("arm.elbow",), np.zeros(1), joint_goal=np.ones(1)), scene)
    with pytest.raises(AnysimError):
        plan(rooms.across(world, allowed=(("arm", "wal"),)), scene)
