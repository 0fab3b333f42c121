"""Legs and gait, without physics: exact kinematics, the signs of the feedbacks, standing, refusals."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import anysim
from anysim.controllers.robot import ControlledRobot
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.testing.quadrupeds import QUADRUPEDS, WITH_ARM, made, spec
from anysim_legged.gait import GaitParameters, Motion, Trot
from anysim_legged.legs import Legs
from anysim_legged.weight import shares
from tests.tiers import often

ALL = slice(None)
DT = 0.02


@cache
def robot_of(name: str) -> ControlledRobot:
    return ControlledRobot(anysim.compile_world(spec(name, "null")), "robot")


@pytest.mark.parametrize("name", often(QUADRUPEDS, [*QUADRUPEDS, *WITH_ARM]))
def test_leg_kinematics_are_the_models(name: str) -> None:
    robot = robot_of(name)
    model, legs = robot.kinematics, Legs.of(robot)
    rng = np.random.default_rng(1)
    low, high = np.maximum(legs.lower, legs.home - 0.4), np.minimum(legs.upper, legs.home + 0.4)
    joints = rng.uniform(low, high, size=(30, *legs.home.shape))
    feet, jacobian = legs.feet(joints), legs.jacobian(joints)
    for row in range(10):
        posture = model.initial.copy()
        posture[legs.columns] = joints[row]
        for i, leg in enumerate(robot.entry.legs.values()):
            frame = model.frame(leg.foot)
            assert np.abs(model.frame_pose(model.q(posture), frame)[:3] - feet[row, i]).max() < 1e-12
            own = model.frame_jacobian(model.q(posture), frame)[:3, 6 + legs.columns[i]]
            assert np.abs(own - jacobian[row, i]).max() < 1e-12
    back = legs.inverse(feet)
    assert back.reached.all()
    assert np.abs(legs.feet(back.joints) - feet).max() < 1e-12
    assert np.abs(back.joints - joints).max() < 1e-9, "the same knee bend and the same turn"


@pytest.mark.parametrize("name", [*QUADRUPEDS, *WITH_ARM])
def test_feet_touch_the_ground_at_home(name: str) -> None:
    robot = robot_of(name)
    legs = Legs.of(robot)
    radii = np.array([leg.radius for leg in robot.entry.legs.values()])
    under = robot.entry.base_height + legs.feet(legs.home[None])[0, :, 2] - radii
    assert np.abs(under).max() < 1e-3
    assert list(robot.entry.legs) == ["FL", "FR", "RL", "RR"]
    corners = np.sign(legs.feet(legs.home[None])[0, :, :2]).tolist()
    assert corners == [[1, 1], [1, -1], [-1, 1], [-1, -1]]


def test_out_of_reach_is_said_and_stretches() -> None:
    legs = Legs.of(robot_of("unitree_go1"))
    far = legs.feet(legs.home[None]) - [0.0, 0.0, 1.0]
    found = legs.inverse(far)
    assert not found.reached.any()
    assert np.isfinite(found.joints).all()
    assert (legs.feet(found.joints)[..., 2] < -0.4).all()


def test_a_leg_of_another_kind_is_refused() -> None:
    robot = robot_of("unitree_go1")
    legs = robot.entry.legs
    turned = legs["FL"].model_copy(update={"joints": tuple(reversed(legs["FL"].joints))})
    strange = ControlledRobot(robot.world, "robot")
    entry = robot.entry.model_copy(update={"legs": {**legs, "FL": turned}})
    strange.robot = replace(robot.robot, entry=entry)
    with pytest.raises(TaskError, match=r"leg 'FL' is of another kind.*'FL_calf_joint'.*along x of the base"):
        Legs.of(strange)


# ---------------------------------------------------------------------- gait

FEET = np.array([[0.2, 0.15, -0.3], [0.2, -0.15, -0.3], [-0.2, 0.15, -0.3], [-0.2, -0.15, -0.3]])


def gait(rows: int = 1, **changes: float) -> Trot:
    values = {"placement": 0.1, "levelling": 0.4, "tracking": 0.0, "in_place": False, **changes}
    made = Trot(FEET, rows, np.array([1.0, 0.5, 1.0]), 0.02, GaitParameters(2.5, 0.06, 0.6, **values))
    made.reset(np.arange(rows), np.tile(FEET, (rows, 1, 1)))
    return made


def motion(velocity=(0.0, 0.0, 0.0), roll: float = 0.0, pitch: float = 0.0) -> Motion:
    return Motion(np.array([velocity]), np.array([roll]), np.array([pitch]))


FORWARD = np.array([[0.5, 0.0, 0.0]])


def test_standing_feet_go_backward_and_diagonals_swing_together() -> None:
    trot, before, swung = gait(), FEET, np.zeros(4, dtype=bool)
    for _ in range(40):
        step = trot.tick(ALL, FORWARD, motion((0.5, 0.0, 0.0)), DT)
        stood = step.stance[0] & (step.velocity[0, :, 2] == 0.0)
        assert (step.velocity[0, stood, 0] == -0.5).all()
        assert (step.stance[0, [0, 3]] == step.stance[0, 0]).all()
        assert (step.stance[0, [1, 2]] == step.stance[0, 1]).all()
        assert step.stance[0].any()
        swung |= ~step.stance[0]
        assert np.abs(step.feet[0] - before).max() < 0.15, "no foot jumps"
        before = step.feet[0]
    assert swung.all()


def test_tilts_are_pushed_back() -> None:
    """The signs that make a robot fall when they are wrong: the low side is pushed up by its legs growing longer."""
    zero = np.zeros((1, 3))
    nose_down = gait().tick(ALL, zero, motion(pitch=0.1), DT).feet[0, :, 2] - FEET[:, 2]
    assert (nose_down[:2] < 0).all() and (nose_down[2:] > 0).all()  # noqa: PT018
    left_up = gait().tick(ALL, zero, motion(roll=0.1), DT).feet[0, :, 2] - FEET[:, 2]
    assert (left_up[[0, 2]] > 0).all() and (left_up[[1, 3]] < 0).all()  # noqa: PT018


def test_swinging_feet_land_ahead_of_a_drift() -> None:
    slow, fast = gait(), gait()
    for _ in range(18):
        a = slow.tick(ALL, FORWARD, motion((0.5, 0.0, 0.0)), DT)
        b = fast.tick(ALL, FORWARD, motion((0.8, 0.0, 0.0)), DT)
    flying = ~a.stance[0]
    assert flying.any()
    assert (b.feet[0, flying, 0] > a.feet[0, flying, 0]).all()


def test_a_lasting_lag_makes_the_feet_faster_within_bounds() -> None:
    trot = gait(tracking=0.5)
    for _ in range(2000):
        trot.tick(ALL, FORWARD, motion(), DT)
    assert trot.slip[0].tolist() == [0.3, 0.0, 0.0], "a robot at a wall does not run away"


def test_zero_plants_the_feet_where_they_began() -> None:
    trot = gait()
    for _ in range(37):
        trot.tick(ALL, FORWARD, motion((0.5, 0.0, 0.0)), DT)
    for _ in range(100):
        step = trot.tick(ALL, np.zeros((1, 3)), motion(), DT)
    assert step.stance.all()
    assert np.abs(step.feet[0] - FEET).max() < 0.01
    again = trot.tick(ALL, np.zeros((1, 3)), motion(), DT)
    assert (again.feet == step.feet).all()
    stepping = gait(in_place=True)
    assert any(not stepping.tick(ALL, np.zeros((1, 3)), motion(), DT).stance.all() for _ in range(20))


def test_rows_and_snapshots_of_a_gait() -> None:
    three, one = gait(3), gait(1)
    commands = np.array([[0.5, 0.0, 0.0], [0.0, 0.3, 0.2], [-0.2, 0.0, 0.0]])
    still = Motion(np.zeros((3, 3)), np.zeros(3), np.zeros(3))
    for _ in range(23):
        batch = three.tick(ALL, commands, still, DT)
        alone = one.tick(ALL, commands[1:2], motion(), DT)
    assert (batch.feet[1] == alone.feet[0]).all()
    ids = np.array([1])
    kept = three.snapshot(ids)
    ahead = three.tick(ids, commands[1:2], motion(), DT)
    three.tick(ids, commands[2:], motion(), DT)
    three.restore(ids, kept)
    assert (three.tick(ids, commands[1:2], motion(), DT).feet == ahead.feet).all()


def test_shares_balance_the_weight() -> None:
    feet, com = FEET[None], np.array([[0.05, 0.02, 0.0]])
    four = shares(np.ones((1, 4), dtype=bool), feet, com)[0]
    assert four.sum() == pytest.approx(1.0)
    assert np.abs(four @ FEET[:, :2] - com[0, :2]).max() < 1e-4
    two = shares(np.array([[True, False, False, True]]), feet, com)[0]
    assert two[[1, 2]].tolist() == [0.0, 0.0]
    assert two[0] > two[3] > 0.0


# ---------------------------------------------------------------------- the controller


def test_feed_forward_carries_the_weight() -> None:
    with made("unitree_go1", "null", 1) as env:
        env.reset(seed=0)
        controller = env.actions.slices[0].controller
        env.actions.act(np.zeros((1, 3)), None)
        command = controller.apply(np.zeros((1, 3)), None)
        assert command.effort is not None
        model, legs = controller.robot.kinematics, Legs.of(controller.robot)
        names = [env.engine.world.joints[j].name for j in env.engine.world.robots[0].channels["base"].joints]
        columns = [model.joint_names.index(n.removeprefix("robot.")) for n in names]
        torque = np.zeros(12)
        torque[columns] = command.effort[0]
        lifted = np.zeros(3)
        for jacobian, leg in zip(legs.jacobian(legs.home[None])[0], legs.columns, strict=True):
            lifted += np.linalg.solve(jacobian.T, -torque[leg])
        assert np.abs(lifted - [0.0, 0.0, 9.81 * model.mass]).max() < 0.01 * 9.81 * model.mass


def test_a_velocity_beyond_the_limits_and_periods_that_do_not_fit() -> None:
    with made("solo12", "null", 1, {"controller": "trot", "params": {"period": 0.01}}) as env:
        env.reset(seed=0)
        low, high = env.action_bounds
        assert high.tolist() == [0.5, 0.25, 0.8]
        assert (low == -high).all()
        assert env.actions.schedule == (5, 5)
    with pytest.raises(TaskError, match=r"control_dt / period is 1\.66667; expected a whole number"):
        made("solo12", "null", 1, {"controller": "trot", "params": {"period": 0.012}})


def test_an_arm_cannot_trot() -> None:
    data = spec("franka_panda", "null")
    data["world"]["robots"]["robot"]["actions"] = {
        "arm": {"controller": "trot", "params": {"frequency": 2.0, "clearance": 0.1, "limits": [1.0, 1.0, 1.0]}}
    }
    with pytest.raises(TaskError, match=r"franka_panda.*cannot walk: its catalogue entry has no `legs`"):
        anysim.make(data)
    del data["world"]["robots"]["robot"]["actions"]["arm"]["params"]["limits"]
    with pytest.raises(TaskError, match=r"trot needs limits of 'robot\.arm'; give them in `params`"):
        anysim.make(data)


def test_rotations_agree_with_the_heading() -> None:
    """`_motion` against a rotation made from its angles."""
    from anysim_legged.trot import _motion

    turn = P.from_roll_pitch_yaw(np.array([[0.1, -0.2, 0.7]]))
    velocity = np.array([[np.cos(0.7), np.sin(0.7), 0.0, 0.0, 0.0, 0.3]])
    found = _motion(np.concatenate([np.zeros((1, 3)), turn], axis=1), velocity)
    assert np.allclose(found.velocity, [[1.0, 0.0, 0.3]])
    assert np.allclose([found.roll[0], found.pitch[0]], [0.1, -0.2])
