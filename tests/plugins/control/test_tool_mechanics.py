"""Controllers of tools on robots with followers, tilted bases and free arms, and operational space, without engines."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from anysim.math import pose as P
from anysim.model.world import Mimic, World
from anysim.testing.tracking import Puppet, errors, robot_world
from anysim_control.tools.link_effort import LinkEffort

PROGRAMS = ("pink_ik", "mink_ik")
IK = ("differential_ik", *PROGRAMS)
PANDA = robot_world("franka_panda", yaw=0.7, position=[0.3, -0.2, 0.1])
TIME_STEP = 0.002
"""[s] of `operational_space`'s efforts."""


def coupled() -> World:
    """A Panda whose sixth joint follows the fourth by a rod, and has no drive in the arm's channel."""
    joints, robot = list(PANDA.joints), PANDA.robots[0]
    joints[5] = replace(joints[5], mimic=Mimic(3, -0.5, joints[5].initial + 0.5 * joints[3].initial))
    arm = robot.channels["arm"]
    driven = tuple(a for a in arm.actuators if PANDA.actuators[a].joint != 5)
    channels = {**robot.channels, "arm": replace(arm, actuators=driven)}
    return replace(PANDA, joints=tuple(joints), robots=(replace(robot, channels=channels),))


@pytest.mark.parametrize("controller", IK)
def test_joints_that_follow_are_reckoned_with(controller: str) -> None:
    robot = Puppet(coupled(), controller, command="position", frame="world").reset()
    assert len(robot.view) == 6
    before, target = robot.joint_pos[0].copy(), robot.tool()
    target[:, :3] += [0.05, 0.05, 0.1]
    for _ in range(60):
        robot.step(target[:, :3])
    assert abs(robot.joint_pos[0, 5] - before[5]) > 0.02, "the follower moved"
    assert P.norm(robot.tool()[:, :3] - target[:, :3]).max() < 1e-4


def centre(robot: Puppet) -> np.ndarray:
    """(2,) of mass, in the axes of the base."""
    from anysim.kinematics.pinocchio_model import pinocchio

    model = robot.robot.kinematics
    found = pinocchio().centerOfMass(model.model, model.model.createData(), model.q(robot.robot.joint_pos(None)[0]))
    return np.array(found)[:2]


@pytest.mark.parametrize("controller", PROGRAMS)
def test_a_cost_on_the_centre_of_mass_moves_the_free_arm(controller: str) -> None:
    world, shifts = robot_world("unitree_g1"), []
    for cost in (0.0, 10.0):
        robot = Puppet(world, controller, tool="left_hand", frame="world", com_cost=cost).reset()
        start, target = centre(robot), robot.tool("left_hand")
        target[:, :3] += [0.1, 0.0, 0.1]
        for _ in range(60):
            robot.step(target)
        assert errors(target, robot.tool("left_hand")).rms < 2e-3
        shifts.append(P.norm(centre(robot) - start))
    assert shifts[0] > 3e-3
    assert shifts[1] < 0.3 * shifts[0]


@pytest.mark.parametrize("frame", ["base", "world"])
@pytest.mark.parametrize("controller", PROGRAMS)
def test_a_floating_base_may_be_tilted(controller: str, frame: str) -> None:
    robot = Puppet(robot_world("unitree_g1"), controller, tool="left_hand", frame=frame)
    tilt = P.from_axis_angle(np.array([0.48, 0.6, 0.64]), np.array(0.6))
    robot.roots[:, robot.robot.root, 3:] = P.multiply(tilt, robot.roots[0, robot.robot.root, 3:])
    robot.reset()
    target = robot.tool("left_hand")
    target[:, :3] += [0.03, 0.02, 0.08]
    base = robot.robot.base_pose(None)
    action = P.compose(P.inverse(base), target) if frame == "base" else target
    for _ in range(60):
        robot.step(action)
    found = errors(target, robot.tool("left_hand"))
    assert found.rms < 1e-4, found
    assert found.turn < 1e-3, found


# ---------------------------------------------------------------------- efforts


def test_dry_friction_is_made_up_for_in_motion_alone() -> None:
    robot = Puppet(robot_world("xarm7"), "pink_ik").reset()
    links, joints = LinkEffort(robot.robot), robot.joint_pos[0]
    still, base = np.zeros(len(joints)), robot.robot.base_pose(None)[0]

    def effort(wanted: float) -> np.ndarray:
        return links.of(joints, still, still, base, still + wanted)

    friction = np.array([joint.friction for joint in robot.world.joints])
    assert friction.min() > 0.0
    np.testing.assert_allclose(effort(0.5) - effort(0.0), friction, rtol=1e-9)
    np.testing.assert_allclose(effort(-0.5) - effort(0.0), -friction, rtol=1e-9)
    np.testing.assert_allclose(effort(0.0), links.of(joints, still, still, base), atol=1e-12)


def operational(num_envs: int = 1, **params: Any) -> Puppet:
    return Puppet(PANDA, "operational_space", num_envs=num_envs, frame="world", **params).reset()


def fall(robot: Puppet, effort: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Joint rates a step later, of links alone in space: Pinocchio's dynamics, no engine."""
    model, links = robot.robot.kinematics, LinkEffort(robot.robot)
    spread, joints = robot.controller.frames.spread, robot.joint_pos[0]
    mass = spread.T @ model.mass_matrix(model.q(joints)) @ spread
    base = robot.robot.base_pose(None)[0]
    carried = spread.T @ links.of(joints, spread @ rate, np.zeros(len(joints)), base)
    rate = rate + TIME_STEP * np.linalg.solve(mass, effort - carried)
    robot.joint_pos[0] += TIME_STEP * spread @ rate
    robot.see()
    robot.robot.state.joint_vel[0] = spread @ rate
    return rate


def test_a_tool_is_a_mass_on_a_spring_in_any_pose() -> None:
    robot = operational(period=TIME_STEP)
    start, rate = robot.tool(), np.zeros(7)
    target, offset = start.copy(), np.array([0.03, -0.04, 0.02])
    target[:, :3] += offset
    way = []
    for step in range(200):
        command = robot.controller.apply(target, None) if step % 10 == 0 else robot.controller.update(None)
        rate = fall(robot, command.effort[0], rate)
        way.append((target[0, :3] - robot.tool()[0, :3]) @ offset / (offset @ offset))
    time, pulse = TIME_STEP * np.arange(1, 201), 20.0
    np.testing.assert_allclose(way, (1.0 + pulse * time) * np.exp(-pulse * time), atol=0.04)
    assert errors(target, robot.tool()).rms < 1e-3
    assert errors(target, robot.tool()).turn < 5e-3


def efforts(robot: Puppet, target: np.ndarray, ids: np.ndarray | None = None) -> np.ndarray:
    """(steps, E, K) of three control steps on robots that stand still."""
    found = []
    for step in range(3):
        target = target + np.array([0.002 * step, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0])
        found += [robot.controller.apply(target, ids).effort]
        found += [robot.controller.update(ids).effort for _ in range(2)]
    return np.array(found)


@pytest.mark.parametrize("drives", ["effort", "position"])
def test_efforts_of_a_row_are_the_same_bits_in_any_batch(drives: str) -> None:
    moved = np.zeros(len(PANDA.joints))
    moved[:7] = [0.1, 0.2, -0.1, 0.3, 0.2, -0.2, 0.1]

    def made(rows: list[int]) -> np.ndarray:
        robot = operational(len(rows), drives=drives)
        robot.joint_pos += np.array(rows)[:, None] * moved
        robot.see()
        return efforts(robot, robot.tool() + np.array(rows)[:, None] * np.array([0.01, 0, 0, 0, 0, 0, 0]))

    whole = made([0, 1, 2])
    assert P.norm(whole[0, 0] - whole[0, 2]) > 0.1
    for row in range(3):
        assert (made([row])[:, 0] == whole[:, row]).all()


def test_operational_space_goes_on_from_a_snapshot() -> None:
    robot = operational(2)
    start, ids = robot.tool(), np.array([1])
    efforts(robot, start + np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    kept = robot.controller.snapshot(ids)
    first = efforts(robot, start)[:, 1]
    robot.controller.restore(ids, kept)
    again = efforts(robot, start[:1], ids)[:, 0]
    assert (first == again).all()
    assert not (efforts(robot, start[:1], ids)[:, 0] == first).all(), "it has a state"
