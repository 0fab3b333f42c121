"""Goals of tools: candidate poses, several tools, straight lines and held objects."""

from dataclasses import replace

import numpy as np

from anysim.planning.motion import Attachment, Pairing, PlanRequest, PlanStatus, Scenes, ToolGoal
from anysim.testing.planners import measure, rooms
from anysim.testing.planners.fixtures import claims, planned

TOUCH = -0.001
NEAR = np.array([0.4, 0.2, 0.1, -0.1, 0.2, 0.1, 0.3])


def test_a_goal_set(world, scene, plan):
    """The candidate that can be reached is chosen, each other one says `no_ik`, and the tool ends in its pose."""
    good = rooms.tool_pose(world, scene, rooms.RIGHT)
    wall = np.array([0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0])
    request = rooms.reach(world, np.stack([rooms.FAR, wall, good]))
    answer = plan(request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.goal_status == (PlanStatus.NO_IK, PlanStatus.NO_IK, PlanStatus.OK)
    assert answer.chosen == (2,)
    path = answer.trajectory.joint_pos
    _assert_there(rooms.tool_pose(world, scene, path[-1]), good)
    assert min(measure.clearance(world, scene, request, path)) >= TOUCH
    assert measure.breaks(world, request, answer.trajectory) == []


def test_out_of_reach(world, scene, plan):
    """Without a candidate that can be reached the answer is `no_ik`, for the whole and for each candidate."""
    answer = plan(rooms.reach(world, np.stack([rooms.FAR, rooms.FAR])), scene)
    assert answer.status is PlanStatus.NO_IK
    assert answer.goal_status == (PlanStatus.NO_IK, PlanStatus.NO_IK)
    assert answer.trajectory is None
    assert answer.message


def test_a_base_that_stands_elsewhere(world, scene, plan):
    """Poses are those of the world: a robot that stands elsewhere reaches those that are there."""
    far = rooms.tool_pose(world, scene, rooms.RIGHT) + np.array([0.0, -1.0, 0, 0, 0, 0, 0])
    assert plan(rooms.reach(world, far[None]), scene).status is PlanStatus.NO_IK
    moved = scene.body_pose.copy()
    moved[:-2, 1] -= 1.0  # the arm alone
    answer = plan(rooms.reach(world, far[None]), scene._replace(body_pose=moved))
    assert answer.status is PlanStatus.OK, answer.message
    _assert_there(rooms.tool_pose(world, scene._replace(body_pose=moved), answer.trajectory.joint_pos[-1]), far)


def test_a_base_that_moves(make_planner):
    """A base is locked, unless its joints are among those of the request: then it goes to where the tool reaches."""
    world = rooms.on_wheels()
    scene, planner = Scenes(world, 1).scene(0), make_planner(world)
    names, start = rooms.joints(world), np.array([joint.initial for joint in world.joints])
    behind = start.copy()
    behind[:3] = 2.0, 0.5, 1.2
    wanted = rooms.tool_pose(world, scene, behind)
    goals = (ToolGoal("arm", "tool", wanted[None]),)
    locked = PlanRequest(names[3:], start[3:], goals, deadline=rooms.LONG)
    assert planned(planner, locked, scene).status is PlanStatus.NO_IK
    request = PlanRequest(names, start, goals, deadline=rooms.LONG)
    answer = planned(planner, request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.trajectory is not None
    path = answer.trajectory.joint_pos
    _assert_there(rooms.tool_pose(world, scene, path[-1]), wanted)
    assert min(measure.clearance(world, scene, request, path)) >= TOUCH
    assert measure.breaks(world, request, answer.trajectory) == []


@claims("paired")
def test_a_tool_that_is_switched_off(pair):
    """A goal that is not enabled counts for nothing and keeps its place, with -1 for its candidate."""
    world, scene, planner = pair
    near = {name: _near(world, scene, name) for name in ("left", "right")}
    goals = (
        ToolGoal("left", "tool", np.stack([rooms.FAR]), enabled=False),
        ToolGoal("right", "tool", np.stack([rooms.FAR, near["right"]])),
    )
    answer = planned(planner, _both(world, goals), scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.chosen == (-1, 1)


@claims("paired")
def test_paired_tools(pair):
    """Tools that are paired take the same candidate: only one that all of them reach."""
    world, scene, planner = pair
    left, right = _near(world, scene, "left"), _near(world, scene, "right")
    goals = (
        ToolGoal("left", "tool", np.stack([left, rooms.FAR, left])),
        ToolGoal("right", "tool", np.stack([rooms.FAR, right, right])),
    )
    request = _both(world, goals)
    answer = planned(planner, request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.chosen == (2, 2)
    assert answer.goal_status == (PlanStatus.NO_IK, PlanStatus.NO_IK, PlanStatus.OK)
    _assert_both_there(world, scene, request, answer, (left, right))
    apart = (replace(goals[0], poses=goals[0].poses[:2]), replace(goals[1], poses=goals[1].poses[:2]))
    assert planned(planner, _both(world, apart), scene).status is PlanStatus.NO_IK


@claims("independent")
def test_independent_tools(pair):
    """Tools that are independent take each its own candidate, from goal sets of any widths."""
    world, scene, planner = pair
    left, right = _near(world, scene, "left"), _near(world, scene, "right")
    goals = (
        ToolGoal("left", "tool", np.stack([left])),
        ToolGoal("right", "tool", np.stack([rooms.FAR, right, rooms.FAR])),
    )
    request = _both(world, goals, pairing=Pairing.INDEPENDENT)
    answer = planned(planner, request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert answer.chosen == (0, 1)
    _assert_both_there(world, scene, request, answer, (left, right))


@claims("straight")
def test_a_straight_line(world, scene, plan):
    """The tool stays within the stated deviation of its line; a line that something blocks is `no_path`."""
    begin = rooms.tool_pose(world, scene, rooms.LEFT)
    end = begin + np.array([-0.05, 0.05, 0.12, 0, 0, 0, 0])
    for deviation in (0.005, 0.001):
        request = rooms.reach(world, end[None], straight=deviation)
        answer = plan(request, scene)
        assert answer.status is PlanStatus.OK, answer.message
        path = measure.filled(answer.trajectory.joint_pos)
        points = rooms.tool_pose(world, scene, path)[:, :3] - begin[:3]
        along = (end - begin)[:3]
        away = points - (points @ along / (along @ along))[:, None] * along
        assert np.linalg.norm(away, axis=1).max() <= 1.2 * deviation
        _assert_there(rooms.tool_pose(world, scene, path[-1]), end)
        assert measure.breaks(world, request, answer.trajectory) == []
    behind = rooms.tool_pose(world, scene, rooms.RIGHT)
    assert plan(rooms.reach(world, behind[None], straight=0.001), scene).status is PlanStatus.NO_PATH


@claims("attached", "joint_goal")
def test_a_held_object(world, scene, plan):
    """What is held moves with its body, at its offset, and collides with all but what holds it."""
    held = Attachment("cube", rooms.HAND, rooms.IN_HAND)
    request = rooms.across(world, attached=(held,))
    answer = plan(request, scene)
    assert answer.status is PlanStatus.OK, answer.message
    path = answer.trajectory.joint_pos
    assert min(measure.clearance(world, scene, request, path)) >= TOUCH
    height = rooms.tool_pose(world, scene, rooms.LEFT)[2]
    low = held._replace(offset=rooms.IN_HAND + np.array([0.0, 0.0, height, 0.0, 0.0, 0.0, 0.0]))
    turned = low._replace(offset=np.array([*low.offset[:3], 0.0, 0.0, np.sin(0.4), np.cos(0.4)]))
    for sunk in (low, turned):
        assert plan(replace(request, attached=(sunk,)), scene).status is PlanStatus.START_IN_COLLISION
    aside = held._replace(offset=rooms.IN_HAND + np.array([0.0, 0.0, 0.06, 0.0, 0.0, 0.0, 0.0]))
    nearby = replace(request, attached=(aside,), joint_goal=rooms.LEFT + np.array([-0.1, 0, 0, 0, 0, 0, 0]))
    assert plan(nearby, scene).status is PlanStatus.OK
    freed = replace(request, attached=(low,), allowed=(("cube", "terrain"),))
    answer = plan(freed, scene)
    assert answer.status is PlanStatus.OK, answer.message
    assert min(measure.clearance(world, scene, freed, answer.trajectory.joint_pos)) >= TOUCH


def _near(world, scene, robot):
    chain = [j.initial for j in world.joints if j.name.startswith(robot)]
    return rooms.tool_pose(world, scene, np.array(chain) + NEAR, robot)


def _both(world, goals, **more):
    start = np.array([joint.initial for joint in world.joints])
    return PlanRequest(rooms.joints(world), start, goals, deadline=rooms.LONG, **more)


def _assert_there(pose, wanted):
    np.testing.assert_allclose(pose[:3], wanted[:3], atol=2e-4)
    assert abs(pose[3:] @ wanted[3:]) > 1 - 1e-7


def _assert_both_there(world, scene, request, answer, wanted):
    path = answer.trajectory.joint_pos
    assert min(measure.clearance(world, scene, request, path)) >= TOUCH
    for number, (robot, pose) in enumerate(zip(("left", "right"), wanted, strict=True)):
        _assert_there(rooms.tool_pose(world, scene, path[-1, 7 * number : 7 * number + 7], robot), pose)
