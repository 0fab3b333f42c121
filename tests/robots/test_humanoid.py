"""The G1 stands, is pushed, squats, reaches and walks with the controllers of its catalogue entry."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_legged.walk import LipmWalk
from anysim_navigation.delay import later

ENGINES = ("mujoco", "pybullet", "sapien")
STEP, TOLD = 0.02, 0.1
SIDES = {"mujoco": (0, 2, 5), "pybullet": (1, 4, 6), "sapien": (0, 3, 7)}
"""From which of eight sides it is often pushed: between them the engines have all."""
PUSHED = pytest.mark.parametrize(
    ("engine", "sides"),
    [
        *(pytest.param(*row, id=f"{row[0]}-some", marks=pytest.mark.slow) for row in SIDES.items()),
        *(pytest.param(engine, tuple(range(8)), id=engine, marks=pytest.mark.full) for engine in ENGINES),
    ],
)


def env(engine: str, controller: str, num_envs: int = 1, arm: str | None = None, robot: str = "unitree_g1") -> TaskEnv:
    """A G1 on a plane, reset."""
    actions = {"base": controller} | ({} if arm is None else {"arm": arm})
    spec: dict[str, Any] = {
        "physics": {"dt": 0.002, "control_dt": STEP},
        "world": {
            "name": "humanoid", "terrain": "plane", "robots": {"g1": {"robot": robot, "actions": actions}}
        },
        "task": {"horizon": 10_000, "observations": {"policy": ["joint_pos"]}},
    }  # fmt: skip
    made = anysim.make(spec, engine=engine, num_envs=num_envs)
    made.reset(seed=0)
    return made


def pelvis(made: TaskEnv) -> np.ndarray:
    """(N, 7)."""
    return np.array(made.engine.get_state().body_pose[:, made.engine.index.entity("g1").root])


def run(made: TaskEnv, action: np.ndarray, seconds: float) -> None:
    """Hold an action."""
    rows = np.tile(action, (made.num_envs, 1))
    for _ in range(round(seconds / STEP)):
        made.step(rows)


def push(made: TaskEnv, speed: float, sides: tuple[int, ...]) -> None:
    """Add a velocity [m/s] to the base of each env, to its own of eight sides: ahead, and on to the left."""
    state, root = made.engine.get_state(), made.engine.index.entity("g1").root
    pose, twist = state.body_pose[:, [root]].copy(), state.body_twist[:, [root]].copy()
    side = np.array(sides) * np.pi / 4.0
    twist[:, 0, :2] += speed * np.stack([np.cos(side), np.sin(side)], axis=1)
    made.engine.set_body_state(pose, twist, np.arange(len(sides)), [root])


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_it_stands_squats_and_comes_back(engine: str) -> None:
    made = env(engine, "default")
    home = np.array(made.engine.get_state().joint_pos)
    start = pelvis(made)
    run(made, np.zeros(6), 5.0)
    assert np.abs(made.engine.get_state().joint_pos - home).max() < 0.05
    run(made, np.array([-0.18, 0, 0, 0, 0, 0]), 3.0)
    assert pelvis(made)[0, 2] - start[0, 2] == pytest.approx(-0.18, abs=0.01)
    run(made, np.zeros(6), 3.0)
    assert np.abs(pelvis(made) - start)[0, :3].max() < 0.01
    made.close()


@PUSHED
def test_pushes_from_eight_sides_do_not_fell_it(engine: str, sides: tuple[int, ...]) -> None:
    made = env(engine, "default", num_envs=len(sides))
    run(made, np.zeros(6), 0.2)
    start = pelvis(made)[:, 2]
    push(made, 0.3, sides)
    run(made, np.zeros(6), 2.0)
    assert (np.abs(pelvis(made)[:, 2] - start) < 0.02).all()
    made.close()


@PUSHED
def test_steps_catch_pushes_that_the_soles_do_not_hold(engine: str, sides: tuple[int, ...]) -> None:
    """Without steps, those from the front and from behind fell it on MuJoCo."""
    made = env(engine, "lipm_walk", num_envs=len(sides))
    run(made, np.zeros(3), 0.5)
    start = pelvis(made)
    push(made, 0.4, sides)
    run(made, np.zeros(3), 4.0)
    moved = np.linalg.norm((pelvis(made) - start)[:, :2], axis=1)
    print(f"{engine}: pelvis {moved.round(3)} m from where it stood, {(pelvis(made) - start)[:, 2].round(4)} m higher")
    assert (np.abs(pelvis(made) - start)[:, 2] < 0.01).all()
    assert np.abs(made.engine.get_state().joint_vel).max() < 0.05, "it stands again"
    assert (moved[np.isin(sides, (0, 4))] > 0.05).all(), "it stepped"
    assert (moved[np.isin(sides, (2, 6))] < 0.01).all(), "feet beside each other hold those from the sides"
    assert moved.max() < 0.6
    made.close()


@pytest.mark.slow
def test_what_it_is_told_is_walked_after_the_delay_of_its_controller() -> None:
    """From where it is it gets, with what it was told before, to where it is by then."""
    made, rng = env("mujoco", "lipm_walk"), np.random.default_rng(0)
    steps = round(made.actions.slice_of("g1", "base").controller.delay / TOLD)
    poses, told, twist, wanted = [], [], np.zeros(3), np.zeros(3)
    for tick in range(400):
        if tick % 20 == 0:
            wanted = rng.uniform(-1.0, 1.0, 3) * (0.25, 0.08, 0.3)
        twist = twist + np.clip(wanted - twist, (-0.025, -0.025, -0.04), (0.025, 0.025, 0.04))
        pose = pelvis(made)[0]
        poses.append([*pose[:2], float(P.yaw(pose[3:]))])
        told.append(twist)
        run(made, twist, TOLD)
    way, said = np.array(poses), np.array(told)
    rows = np.arange(100, 380 - steps)
    off = []
    for since in (steps, 0):
        sent = np.stack([said[row - since : row - since + steps] for row in rows])
        off.append(np.hypot(*(later(way[rows], sent) - way[rows + steps])[:, :2].T))
    print(f"off by {off[0].mean():.3f} m, {off[1].mean():.3f} m without delay")
    assert off[0].mean() < 0.5 * off[1].mean()
    made.close()


@pytest.mark.parametrize(
    "engine", [pytest.param(e, marks=pytest.mark.slow if e == "mujoco" else pytest.mark.full) for e in ENGINES]
)
def test_it_walks_three_metres_with_two_turns(engine: str) -> None:
    made = env(engine, "lipm_walk")
    controller = made.actions.slice_of("g1", "base").controller
    assert isinstance(controller, LipmWalk)
    start, planned, height = centre(controller), controller.planned()[0], pelvis(made)[0, 2]
    ahead, left, right = np.array([0.25, 0.0, 0.0]), np.array([0.0, 0.0, 0.3]), np.array([0.0, 0.0, -0.3])
    far, before = 0.0, start
    for action, seconds in ((ahead, 5.3), (left, 6.5), (ahead, 5.3), (right, 6.5), (ahead, 5.3), (np.zeros(3), 4.0)):
        run(made, action, seconds)
        here = centre(controller)
        far, before = far + float(np.linalg.norm(here - before)), here
        plan = controller.planned()[0] - planned
        assert np.linalg.norm(here - start - plan) < 0.03, "where it planned to be"
        assert abs(pelvis(made)[0, 2] - height) < 0.02
    print(f"{engine}: {far:.2f} m, to {(before - start).round(3)} of {plan.round(3)}")
    assert far > 3.0
    assert np.abs(made.engine.get_state().joint_vel).max() < 0.05, "it stands after the last step"
    made.close()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_it_steps_aside(engine: str) -> None:
    made = env(engine, "lipm_walk")
    controller = made.actions.slice_of("g1", "base").controller
    assert isinstance(controller, LipmWalk)
    start, planned = centre(controller), controller.planned()[0]
    run(made, np.array([0.0, 0.1, 0.0]), 6.0)
    moved, plan = centre(controller) - start, controller.planned()[0] - planned
    assert plan[1] > 0.3
    assert np.linalg.norm(moved - plan) < 0.02
    made.close()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_it_balances_arms_that_another_controller_moves(engine: str) -> None:
    made = env(engine, "default", arm="joint_position")
    arm = made.actions.slice_of("g1", "arm").controller.channel
    start = pelvis(made)
    home = arm.robot.joint_pos(None)[0, arm.joint_columns]
    action = np.concatenate([np.zeros(6), home])
    for side in (0, 7):
        action[6 + side] -= 1.2  # shoulders: both hands forward and up
    for k in range(100):
        made.step((action * min(1.0, k / 75.0) + np.concatenate([np.zeros(6), home]) * max(0.0, 1.0 - k / 75.0))[None])
    run(made, action, 2.0)
    assert np.abs(pelvis(made)[0, 2] - start[0, 2]) < 0.02
    assert np.abs(arm.robot.joint_pos(None)[0, arm.joint_columns] - action[6:]).max() < 0.1
    made.close()


def centre(controller: LipmWalk) -> np.ndarray:
    """Where the measured centre of mass is (2,) [m], world frame."""
    robot, whole = controller.robot, controller.tracker.whole
    base = robot.base_pose(None)[0]
    q = whole.model.q(robot.joint_pos(None)[0], base)
    v = whole.model.v(robot.joint_vel(None)[0], base, robot.base_twist(None)[0])
    return np.array(whole.measured(q, v)[0][:2])


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_it_walks_where_it_planned(engine: str) -> None:
    made = env(engine, "lipm_walk")
    controller = made.actions.slice_of("g1", "base").controller
    assert isinstance(controller, LipmWalk)
    start, planned, height = centre(controller), controller.planned()[0], pelvis(made)[0, 2]
    run(made, np.array([0.2, 0.0, 0.0]), 10.0)
    moved, plan = centre(controller) - start, controller.planned()[0] - planned
    assert plan[0] > 1.2
    assert np.linalg.norm(moved - plan) < 0.02 * np.linalg.norm(plan), "the same point of the body at the same instant"
    assert abs(pelvis(made)[0, 2] - height) < 0.02
    run(made, np.zeros(3), 4.0)
    assert np.abs(pelvis(made)[0, 2] - height) < 0.005, "it stands after the last step"
    assert np.abs(made.engine.get_state().joint_vel).max() < 0.05
    made.close()


@pytest.mark.slow
def test_arms_with_hands_do_not_swing_up_by_themselves() -> None:
    made = env("mujoco", "default", robot="unitree_g1_hands")
    home = np.array(made.engine.get_state().joint_pos)
    run(made, np.zeros(6), 6.0)
    assert np.abs(made.engine.get_state().joint_pos - home).max() < 0.01
    made.close()


def test_a_snapshot_of_a_step_continues_bit_for_bit() -> None:
    made = env("mujoco", "lipm_walk", num_envs=2)
    run(made, np.array([0.2, 0.05, 0.1]), 1.5)
    saved = made.snapshot()
    run(made, np.array([0.2, 0.05, 0.1]), 0.5)
    once = np.array(made.engine.get_state().joint_pos)
    made.reset_to(saved)
    run(made, np.array([0.2, 0.05, 0.1]), 0.5)
    assert (made.engine.get_state().joint_pos == once).all()
    assert (once[0] == once[1]).all(), "a row does not depend on its place"
    made.close()


@pytest.mark.slow
def test_a_snapshot_of_a_catching_step_continues_bit_for_bit() -> None:
    made = env("mujoco", "lipm_walk", num_envs=3)
    run(made, np.zeros(3), 0.2)
    push(made, 0.4, (0, 3, 4))
    run(made, np.zeros(3), 0.3)
    saved = made.snapshot()
    run(made, np.zeros(3), 0.5)
    once = np.array(made.engine.get_state().joint_pos)
    made.reset_to(saved)
    run(made, np.zeros(3), 0.5)
    assert (made.engine.get_state().joint_pos == once).all()
    made.close()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_it_reaches_with_both_hands_as_it_stands(engine: str) -> None:
    """`pink_ik` moves both arms as one problem, seen from a trunk that the balance lets lean and sag."""
    made = env(engine, "default", arm="pink_ik")
    arm = made.actions.slice_of("g1", "arm").controller
    start, robot = pelvis(made), arm.channel.robot

    def hands() -> np.ndarray:
        """Poses (2, 7) in the base's frame."""
        robot.see(made.engine.get_state())
        base = P.inverse(robot.base_pose(None)[0])
        return np.array([P.compose(base, robot.frame_pose(None, name)[0]) for name in ("left_hand", "right_hand")])

    wanted = hands()
    began = wanted.copy()
    wanted[:, :3] += [0.15, 0.0, 0.15]
    for k in range(150):
        share = min(1.0, k / 75.0)
        target = wanted.copy()
        target[:, :3] = began[:, :3] + share * (wanted - began)[:, :3]
        made.step(np.concatenate([np.zeros(6), target.reshape(-1)])[None])
    off = np.linalg.norm((hands() - wanted)[:, :3], axis=1)
    moved = np.abs(pelvis(made) - start)[0, :3].max()
    print(f"{engine}: hands {1e3 * off.max():.3f} mm off, pelvis {1e3 * moved:.2f} mm from where it was")
    assert off.max() < 0.002
    assert moved < 0.03
    made.close()
