"""Joint positions without a path: free ones at the poses of tools, whatever else is asked at the same time."""

from dataclasses import replace

import numpy as np

from anysim.planning.motion import Budget, PlanRequest, PlanStatus, RequestKind, ToolGoal
from anysim.testing.planners import measure, rooms
from anysim.testing.planners.fixtures import claims, planned

TOUCH = -0.001
SHIFTS = ((0.0, 0.0, 0.0), (0.03, 0.0, 0.05), (-0.02, 0.04, 0.0), (0.0, -0.03, 0.08), (0.04, 0.04, 0.04))
"""[m] of poses around one that is reached."""


@claims("ik")
def test_joint_positions(world, scene, plan):
    """The tool is at the chosen pose, within the joints' limits, nothing touches, and there is no trajectory."""
    wall = np.array([0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0])
    request = _around(world, scene, [rooms.FAR, wall])
    assert request.kind is RequestKind.IK
    answer = plan(request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.goal_status[:2] == (PlanStatus.NO_IK, PlanStatus.NO_IK)
    assert answer.goal_status[answer.chosen[0]] is PlanStatus.OK
    assert answer.trajectory is None
    _assert_right(world, scene, request, answer)


@claims("ik")
def test_what_is_out_of_reach(world, scene, plan):
    """Without a candidate that can be reached the answer is `no_ik`, for the whole and for each candidate."""
    answer = plan(rooms.reach(world, np.stack([rooms.FAR, rooms.FAR]), path=False), scene)
    assert answer.status is PlanStatus.NO_IK
    assert answer.goal_status == (PlanStatus.NO_IK, PlanStatus.NO_IK)
    assert answer.joint_pos is None
    assert answer.message


@claims("ik")
def test_a_start_in_collision(world, scene, plan):
    """The start is where to look first and nothing moves from there, so it may be in collision."""
    inside = replace(_around(world, scene), start=np.array([0.0, 1.2, 0.0, -1.2, 0.0, 2.4, 0.785]))
    _assert_right(world, scene, inside, plan(inside, scene))


@claims("ik")
def test_many_together(world, scene, planner):
    """Requests that are answered together get the very answers that each gets alone, in whatever order they come."""
    asked = [replace(_around(world, scene), seed=k, start=rooms.LEFT + 0.1 * k) for k in range(5)]
    asked.append(rooms.reach(world, rooms.FAR[None], path=False))
    alone = [planned(planner, request, scene) for request in asked]
    for order in (range(len(asked)), [3, 0, 5, 4, 1, 2]):
        budgets = [Budget(rooms.LONG) for _ in order]
        together = planner.plan_all([asked[k] for k in order], [scene] * len(asked), budgets)
        for k, answer in zip(order, together, strict=True):
            assert _said(answer) == _said(alone[k])


@claims("ik", "paired")
def test_two_tools(pair):
    """Both tools are at the same candidate, and the robots do not touch."""
    world, scene, planner = pair
    start = np.array([joint.initial for joint in world.joints])
    near = np.array([0.4, 0.2, 0.1, -0.1, 0.2, 0.1, 0.3])
    poses = [rooms.tool_pose(world, scene, start[k : k + 7] + near, name) for name, k in (("left", 0), ("right", 7))]
    sets = (np.stack([poses[0], rooms.FAR, poses[0]]), np.stack([rooms.FAR, poses[1], poses[1]]))
    goals = tuple(ToolGoal(name, "tool", rows) for name, rows in zip(("left", "right"), sets, strict=True))
    request = PlanRequest(rooms.joints(world), start, goals, deadline=rooms.LONG, path=False)
    assert request.kind is RequestKind.DUAL_IK
    answer = planned(planner, request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.chosen == (2, 2)
    assert answer.joint_pos is not None
    assert min(measure.clearance(world, scene, request, answer.joint_pos[None])) >= TOUCH
    for number, (name, pose) in enumerate(zip(("left", "right"), poses, strict=True)):
        _assert_there(rooms.tool_pose(world, scene, answer.joint_pos[7 * number : 7 * number + 7], name), pose)


def _said(answer):
    joints = None if answer.joint_pos is None else answer.joint_pos.tolist()
    return answer.status, answer.chosen, answer.goal_status, joints


def _around(world, scene, more=()):
    good = rooms.tool_pose(world, scene, rooms.RIGHT)
    shifted = [good + np.array([*shift, 0.0, 0.0, 0.0, 0.0]) for shift in SHIFTS]
    return rooms.reach(world, np.stack([*more, *shifted]), path=False)


def _assert_right(world, scene, request, answer):
    assert answer.status is PlanStatus.OK, answer.message
    q = answer.joint_pos
    lower, upper = (np.array([getattr(j, name) for j in world.joints]) for name in ("lower", "upper"))
    names = [joint.name for joint in world.joints]
    order = [names.index(name) for name in request.joints]
    assert ((q >= lower[order] - 1e-6) & (q <= upper[order] + 1e-6)).all()
    assert min(measure.clearance(world, scene, request, q[None])) >= TOUCH
    _assert_there(rooms.tool_pose(world, scene, q), request.goals[0].poses[answer.chosen[0]])


def _assert_there(pose, wanted):
    np.testing.assert_allclose(pose[:3], wanted[:3], atol=2e-4)
    assert abs(pose[3:] @ wanted[3:]) > 1 - 1e-7
