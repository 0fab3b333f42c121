"""Pieces of standing and walking whose answers are known: pendulum, soles, whole-body postures, feed-forward."""

from typing import Any, cast

import numpy as np
import pytest

from anysim.compile.world import compile_world
from anysim.controllers.base import ChannelView
from anysim.controllers.robot import ControlledRobot
from anysim.errors import TaskError
from anysim_legged.balance import HumanoidBalance
from anysim_legged.contact import Pushes, pressure, share_of, shifted
from anysim_legged.footsteps import Footsteps, Gait
from anysim_legged.preview import Preview
from anysim_legged.support import convex_hull, nearest_inside, shrunken, turned
from anysim_legged.wholebody import Targets, WholeBody
from anysim_schemas.run import WorldSpec

OMEGA, TICK = 3.8, 0.01


def channel(robot: str, name: str = "base") -> ChannelView:
    """A channel of a robot alone in a world."""
    spec: dict[str, Any] = {"name": "alone", "robots": {"r": {"robot": robot}}}
    world = compile_world(WorldSpec.model_validate(spec))
    return ChannelView.of(world, world.robots[0].channels[name], ControlledRobot(world, "r"))


@pytest.fixture(scope="module")
def whole() -> WholeBody:
    view = channel("unitree_g1")
    return WholeBody(view.robot.kinematics, view)


def test_the_preview_solves_the_tridiagonal_system() -> None:
    preview = Preview(OMEGA, TICK, 4.0)
    times = preview.times
    pressure = np.stack([np.interp(times, [0.5, 0.7], [0.0, 0.1]), np.interp(times, [1.0, 1.2], [0.05, -0.1])], axis=1)
    start = np.array([0.01, -0.02])
    b, n = (OMEGA * TICK) ** 2, len(times)
    matrix = np.diag(np.full(n, 2.0 + b)) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    right = b * pressure
    right[0] += start
    right[-1] += pressure[-1]  # at rest above the last pressure
    assert np.allclose(preview.next(start, pressure), np.linalg.solve(matrix, right)[0], atol=1e-6)


def test_a_pendulum_above_a_resting_pressure_comes_to_rest_at_its_own_rate() -> None:
    preview = Preview(OMEGA, TICK, 1.0)
    com = np.array([0.02, 0.0])
    for _ in range(50):
        com = preview.next(com, np.zeros((len(preview.times), 2)))
    assert com[0] == pytest.approx(0.02 * np.exp(-OMEGA * 0.5), rel=1e-3)


def test_a_pendulum_swings_by_less_than_its_pressure() -> None:
    preview, rate = Preview(OMEGA, TICK, 4.0), 2.0 * np.pi
    com, far = np.zeros(2), []
    for k in range(600):
        swing = np.sin(rate * (k * TICK + preview.times))
        com = preview.next(com, np.stack([swing, swing], axis=1))
        far.append(com[0])
    assert max(far[300:]) == pytest.approx(OMEGA**2 / (OMEGA**2 + rate**2), rel=5e-3)


def test_the_hull_keeps_the_nearest_point() -> None:
    corners = convex_hull(np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0.5, 0.0]], dtype=float))
    assert len(corners) == 4
    assert np.allclose(nearest_inside(np.array([0.2, 0.7]), corners), [0.2, 0.7])
    assert np.allclose(nearest_inside(np.array([2.0, 0.5]), corners), [1.0, 0.5])
    assert np.allclose(nearest_inside(np.array([-1.0, -1.0]), corners), [0.0, 0.0])


def test_a_rim_never_takes_the_whole_sole() -> None:
    sole = np.array([-0.05, 0.12, -0.03, 0.03])
    assert np.allclose(shrunken(sole, 0.01), [-0.04, 0.11, -0.02, 0.02])
    assert np.allclose(shrunken(sole, 1.0), [0.035 - 0.0085, 0.035 + 0.0085, -0.003, 0.003])


def test_moving_the_pressure_moves_it_by_that_and_turns_nothing() -> None:
    force, com = np.array([3.0, -2.0, 320.0]), np.array([0.03, 0.01, 0.67])
    torque = np.cross(com, force) + np.array([1.0, 2.0, 0.0])
    by = np.array([0.02, -0.01])
    more, about = shifted(force, torque, by, com)
    assert np.allclose(pressure(more, about), pressure(force, torque) + by)
    assert np.allclose(about - np.cross(com, more), torque - np.cross(com, force)), "nothing about the centre of mass"


def test_feet_share_the_force_by_where_it_is() -> None:
    middles = np.array([[0.0, 0.1], [0.0, -0.1]])
    assert np.allclose(share_of(np.array([0.05, 0.0]), middles), [0.5, 0.5])
    assert np.allclose(share_of(np.array([0.0, 0.05]), middles), [0.75, 0.25])
    assert np.allclose(share_of(np.array([0.0, -0.3]), middles), [0.0, 1.0])


def test_a_posture_keeps_feet_centre_of_mass_and_pelvis(whole: WholeBody) -> None:
    home = whole.home
    com, _, places = whole.measured(home, np.zeros(whole.model.model.nv))
    targets = Targets(places, np.zeros(2), com[:2], home[2] - 0.1, whole.upright)
    q = home
    for _ in range(20):
        q = whole.solve(q, targets, home[7 + whole.columns])
    assert np.abs(whole.places(q) - places).max() < 1e-4
    assert q[2] == pytest.approx(home[2] - 0.1, abs=2e-3), "the posture pulls a little"
    assert np.abs(whole.model.com(q)[:2] - com[:2]).max() < 1e-3
    assert (q[7 + whole.others] == home[7 + whole.others]).all(), "arms are somebody else's"


def test_feed_forward_holds_every_joint_against_weight(whole: WholeBody) -> None:
    import pinocchio as pin  # pyright: ignore[reportMissingImports]

    view = channel("unitree_g1")
    pushes = Pushes(whole, view.robot, whole.soles)
    model, data, nv = whole.model.model, whole.model.data, whole.model.model.nv
    still = np.zeros(nv)
    efforts, force, torque = pushes.required(whole.home, still, still)
    places = whole.places(whole.home)
    shares = share_of(pressure(force, torque), whole.middles(places))
    drives = pushes.solve(whole.home, efforts, force, torque, places, np.zeros(2), shares)
    assert force == pytest.approx([0.0, 0.0, 9.81 * whole.mass], abs=0.02 * whole.mass)
    own = np.zeros(nv)
    own[6 + view.robot.drive_columns] = drives
    middles = whole.middles(places)
    pin.computeJointJacobians(model, data, whole.home)
    pin.updateFramePlacements(model, data)
    for k, frame in enumerate(whole.feet):
        arm = np.array([*middles[k], 0.0]) - data.oMf[frame].translation
        wrench = pushes.wrenches[k].copy()
        wrench[3:] += np.cross(arm, wrench[:3])
        own += pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED).T @ wrench
    needed = pin.rnea(model, data, whole.home, still, still)
    assert np.allclose(own, needed, atol=1e-3), "drives and ground carry it all"


def test_feet_press_only_within_their_soles(whole: WholeBody) -> None:
    view = channel("unitree_g1")
    pushes = Pushes(whole, view.robot, whole.soles)
    still = np.zeros(whole.model.model.nv)
    efforts, force, torque = pushes.required(whole.home, still, still)
    places = whole.places(whole.home)
    far = torque + np.array([0.0, -force[2] * 1.0, 0.0])  # a metre ahead
    pushes.solve(whole.home, efforts, force, far, places, np.zeros(2), np.array([0.5, 0.5]))
    for k in range(2):
        ahead = -pushes.wrenches[k, 4] / pushes.wrenches[k, 2]
        assert ahead == pytest.approx((whole.soles[k, 1] - whole.soles[k, 0]) / 2.0)


def test_a_swinging_leg_and_a_sway_move_the_pressure_as_inverse_dynamics_says(whole: WholeBody) -> None:
    com, _, places = whole.measured(whole.home, np.zeros(whole.model.model.nv))
    posture, gravity = whole.home[7 + whole.columns], 9.81
    pushes = Pushes(whole, channel("unitree_g1").robot, whole.soles)
    still = np.zeros(whole.model.model.nv)

    def pressed(feet: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Where the ground presses while the feet and the centre of mass begin to move with these accelerations."""
        targets = Targets(
            places + np.pad(feet, ((0, 0), (0, 1))) * 1e-4,
            np.zeros(2),
            com[:2] + moved * 1e-4,
            float(whole.home[2]),
            whole.upright,
        )
        there = whole.solve(whole.home, targets, posture, iterations=4)
        _, force, torque = pushes.required(whole.home, still, whole.difference(whole.home, there) / 1e-4)
        return np.array([-torque[1], torque[0]]) / force[2]

    nothing = np.zeros((2, 2))
    forward = nothing.copy()
    forward[0, 0] = 1.0
    swing = pressed(forward, np.zeros(2)) - pressed(nothing, np.zeros(2))
    assert np.allclose(swing, whole.swing_pressure()[0, :, 0], atol=3e-4)
    for k, height in enumerate(whole.pendulum_height()):
        sway = pressed(nothing, np.eye(2)[k]) - pressed(nothing, np.zeros(2))
        assert sway[k] == pytest.approx(-height / gravity, rel=0.01)
    assert whole.pendulum_height()[1] > com[2], "legs that turn about the feet make the pendulum longer"


def test_drives_that_others_command_get_no_effort_from_their_measured_acceleration(whole: WholeBody) -> None:
    pushes = Pushes(whole, channel("unitree_g1").robot, whole.soles)
    still = np.zeros(whole.model.model.nv)
    moving = still.copy()
    moving[6 + whole.others] = 5.0
    calm, _, _ = pushes.required(whole.home, still, still)
    efforts, force, torque = pushes.required(whole.home, still, moving)
    assert np.allclose(efforts[6 + whole.others], calm[6 + whole.others])
    assert np.abs(torque - pushes.required(whole.home, still, still)[2]).max() > 0.1, "the ground does carry it"
    assert np.isfinite(force).all()


def test_footsteps_walk_at_the_commanded_speed_and_end_side_by_side() -> None:
    gait = Gait(double=0.2, single=0.5, clearance=0.05, lead=1.0, width=0.2)
    steps = Footsteps(gait, TICK, 1, np.zeros((2, 2, 3)))
    steps.begin(0, np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]))
    lifts, still = [], np.zeros(3)
    for k in range(1500):
        command = np.array([0.2, 0.0, 0.0]) if k < 1000 else still
        feet = steps.now(0)
        steps.advance(0, command, feet.places[:, :2], still)
        lifts.append(feet.lift)
    end = steps.now(0)
    assert end.standing == (True, True)
    assert np.allclose(end.places[0] - end.places[1], [0.0, 0.2, 0.0], atol=1e-9)
    assert end.places[0, 0] == pytest.approx(0.2 * 10.0, rel=0.2)
    assert np.max(lifts) == pytest.approx(0.05, abs=1e-4)
    assert (np.min(lifts, axis=1) == 0.0).all(), "one foot always stands"


def test_a_turned_place_is_in_the_frame_of_the_other() -> None:
    assert np.allclose(turned(np.array([1.0, 2.0, np.pi / 2]), 1.0, 0.0, 0.1), [1.0, 3.0, np.pi / 2 + 0.1])


def test_robots_without_soles_are_refused_in_words() -> None:
    with pytest.raises(TaskError, match=r"needs the legs 'left' and 'right', each with a flat `sole`.*no sole"):
        HumanoidBalance(channel("bolt"), 1)


def test_a_gain_that_cannot_balance_is_refused() -> None:
    with pytest.raises(TaskError, match="above 1"):
        HumanoidBalance(cast(ChannelView, channel("unitree_g1")), 1, gain=0.5)
