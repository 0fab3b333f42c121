"""Answers: what they depend on, when they come, and what they tell."""

from time import perf_counter

import numpy as np

from anysim.planning.motion import Budget, PlanStatus
from anysim.testing.planners import rooms
from anysim.testing.planners.fixtures import LATE, claims, planned


def _same(first, second):
    """Whether two answers are equal to the bit, timings aside."""
    if (first.status, first.chosen, first.goal_status) != (second.status, second.chosen, second.goal_status):
        return False
    rows = zip(first.trajectory or (), second.trajectory or (), strict=True)
    return all(np.array_equal(a, b) for a, b in rows)


@claims("joint_goal")
def test_an_answer_depends_on_its_request_alone(world, scene, make_planner, planner):
    """A new planner answers as one that has planned before; batches and their order change nothing."""
    sets = np.stack([rooms.tool_pose(world, scene, rooms.RIGHT), rooms.FAR])
    requests = [rooms.across(world, seed=3), rooms.reach(world, sets, seed=4), rooms.across(world, seed=5)]
    alone = [planned(make_planner(world), request, scene) for request in requests]
    assert all(answer.status is PlanStatus.OK for answer in alone)
    for order in ([0, 1, 2], [2, 1, 0]):
        batch = planner.plan_all(
            [requests[i] for i in order], [scene] * 3, [Budget(requests[i].deadline) for i in order]
        )
        assert all(_same(answer, alone[i]) for answer, i in zip(batch, order, strict=True))


@claims("joint_goal")
def test_other_scenes_leave_no_trace(world, scene, planner):
    """An answer is the same after plans in other scenes, with other padding and with other allowed pairs."""
    request = rooms.across(world, seed=1)
    before = planned(planner, request, scene)
    moved = scene.body_pose.copy()
    moved[-2:, 0] += 0.4
    planned(planner, request, scene._replace(body_pose=moved))
    planned(planner, rooms.across(world, padding=0.02), scene)
    planned(planner, rooms.across(world, allowed=(("arm", "wall"),)), scene)
    assert _same(planned(planner, request, scene), before)


@claims("joint_goal")
def test_a_deadline_ends_a_search(world, scene, planner):
    """A search whose time is over answers `timeout`, soon, and the next request has its own time."""
    late = Budget(1e-9)
    late.begin()
    begun = perf_counter()
    answer = planner.plan(rooms.across(world), scene, late)
    assert perf_counter() - begun < LATE
    assert answer.status is PlanStatus.TIMEOUT
    assert answer.trajectory is None
    assert planned(planner, rooms.across(world), scene).status is PlanStatus.OK


@claims("joint_goal")
def test_a_cancelled_search_ends(world, scene, planner):
    """A request that was cancelled answers `cancelled`, and the next one is answered."""
    budget = Budget(5.0)
    budget.begin()
    budget.cancel()
    assert planner.plan(rooms.across(world), scene, budget).status is PlanStatus.CANCELLED
    assert planned(planner, rooms.across(world), scene).status is PlanStatus.OK


@claims("joint_goal")
def test_an_answer_says_where_it_comes_from(world, scene, planner):
    """It names its planner and the version of its scene, and leaves the scene and the request as they were."""
    later = scene._replace(version=7, body_pose=scene.body_pose.copy())
    request = rooms.across(world)
    answer = planned(planner, request, later)
    assert answer.world_version == 7
    assert type(planner).name in answer.solver
    assert answer.goal_status == (PlanStatus.OK,)
    np.testing.assert_array_equal(later.body_pose, scene.body_pose)
    np.testing.assert_array_equal(request.start, rooms.LEFT)
    assert answer.trajectory is not None
    assert planner.is_free(request, later, answer.trajectory.joint_pos)
