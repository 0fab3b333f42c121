"""The terms of walking robots: gaits by the clock, how a base moves, what disturbs it, against what was worked out."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.term_registry import bind
from anysim.testing.engines import require_engine

HEIGHT = 0.3168
"""Of a Go1 whose feet touch the ground at home [m]."""
DOG: dict[str, Any] = {
    "engine": "null",
    "physics": {"dt": 0.004, "control_dt": 0.02},
    "world": {
        "name": "dog",
        "terrain": "plane",
        "robots": {"dog": {"robot": "unitree_go1", "actions": {"base": "pd"}}},
    },
    "task": {
        "horizon": 200,
        "command": {"walk": {"term": "tasks.velocity", "forward": 0.5}},
        "observations": {"policy": [{"term": "tasks.clock", "frequency": 2.5}]},
    },
}
ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]


def dog(num_envs: int = 1, **changes: Any) -> TaskEnv:
    return anysim.make({**DOG, **changes}, num_envs=num_envs)


def put(env: TaskEnv, height: float = HEIGHT, pitch: float = 0.0, twist: Array | None = None) -> None:
    root = env.engine.index.entity("dog").root
    pose = np.array([[0.0, 0.0, height, *P.from_roll_pitch_yaw(np.array([0.0, pitch, 0.0]))]] * env.num_envs)
    speed = np.zeros((env.num_envs, 6)) if twist is None else np.tile(twist, (env.num_envs, 1))
    env.engine.set_body_state(pose[:, None], speed[:, None], None, [root])
    env.scene.look(None)


def said(env: TaskEnv, term: str, kind: str = "reward", **params: Any) -> float:
    return float(bind(kind, f"tasks.{term}", params, env.scene, "t")()[0])


def test_the_clock_says_which_feet_stand() -> None:
    with dog() as env:
        env.reset(seed=0)
        for steps, share in ((0, 1.0), (2, 0.5), (10, 1.0), (12, 0.5)):  # 0.05 of a stride each
            env.scene.elapsed[:] = steps
            put(env)
            assert said(env, "gait_contact", frequency=2.5) == share
            turn = 2.0 * np.pi * 0.05 * steps
            clock = bind("observation", "tasks.clock", {"frequency": 2.5}, env.scene, "t")()
            np.testing.assert_allclose(clock, [[np.sin(turn), np.cos(turn)]], atol=1e-12)
        put(env, HEIGHT + 0.01)  # all feet in the air: those are right that shall swing
        assert said(env, "gait_contact", frequency=2.5) == 0.5


def test_swinging_feet_rise_and_come_down() -> None:
    with dog() as env:
        env.reset(seed=0)
        env.scene.elapsed[:] = 5  # phases 0.25 and 0.75
        for above in (0.0, 0.03, 0.06):
            put(env, HEIGHT + above)
            wanted = 0.1 * (1.0 - np.cos(2.0 * np.pi * (0.75 - 0.55) / 0.45))
            np.testing.assert_allclose(
                said(env, "swing_height_l2", frequency=2.5), 2.0 * (above / HEIGHT - wanted) ** 2, atol=1e-4
            )


STEP = {"kind": "pits", "depth": 0.1, "platform": 1.2, "cell": 0.1, "size": [4.0, 4.0]}
"""Up by 0.1 m from x 0.6 to 0.7 m; the robot begins at the bottom."""


def on_a_step(env: TaskEnv, x: float, height: float) -> None:
    root = env.engine.index.entity("dog").root
    env.engine.set_body_state(np.array([[[x, 0.0, height, 0.0, 0.0, 0.0, 1.0]]]), None, None, [root])
    env.scene.look(None)


def test_a_swinging_foot_is_to_clear_the_step_ahead() -> None:
    world = {**DOG["world"], "terrain": STEP}
    with dog(world=world) as env:
        env.reset(seed=0)
        env.scene.elapsed[:] = 5  # phases 0.25 and 0.75: a front foot swings, and the hind foot across
        lift = 0.5 * (1.0 - np.cos(2.0 * np.pi * (0.75 - 0.55) / 0.45))
        foot = env.engine.index.frame("dog.FL_foot")
        pose = env.scene.state.body_pose[0, foot.body]
        front = float((pose[:3] + P.rotate(pose[3:], np.array(foot.position)))[0])
        for ahead, ground, rise in ((0.15, 0.0, 0.0), (0.05, 0.0, 0.05), (-0.05, 0.05, 0.05), (-0.15, 0.1, 0.0)):
            on_a_step(env, 0.6 - ahead - front, HEIGHT)
            wanted = lift * (0.2 + rise / HEIGHT), lift * 0.2
            found = said(env, "swing_height_l2", frequency=2.5, around=0.1)
            swung = (-ground / HEIGHT - wanted[0]) ** 2 + wanted[1] ** 2
            np.testing.assert_allclose(found, swung, atol=2e-4, err_msg=f"{ahead} m before the step")


def test_a_base_over_a_step_is_as_high_as_over_its_feet() -> None:
    with dog(world={**DOG["world"], "terrain": STEP}) as env:
        env.reset(seed=0)
        for x, mean in ((0.0, 0.0), (0.72, 0.05), (1.5, 0.1)):  # all feet below, two, none
            on_a_step(env, x, HEIGHT + mean)
            np.testing.assert_allclose(said(env, "base_height_l2", share=1.0), 0.0, atol=1e-6)
            on_a_step(env, x, 0.49 * HEIGHT + mean)
            assert said(env, "base_sunk", "predicate") == 1.0
            on_a_step(env, x, 0.51 * HEIGHT + mean)
            assert said(env, "base_sunk", "predicate") == 0.0


def test_feet_slide_with_the_base_while_they_touch_the_ground() -> None:
    with dog() as env:
        env.reset(seed=0)
        put(env, twist=np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0]))
        np.testing.assert_allclose(said(env, "feet_slide"), 4 * 0.09, rtol=1e-6)
        put(env, HEIGHT + 0.02, twist=np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0]))
        assert said(env, "feet_slide") == 0.0


def test_how_the_base_moves_and_stands() -> None:
    with dog() as env:
        env.reset(seed=0)
        put(env, 0.25, twist=np.array([0.5, 0.1, 0.2, 0.3, -0.4, 0.7]))
        np.testing.assert_allclose(said(env, "lin_vel_z_l2"), 0.04)
        np.testing.assert_allclose(said(env, "ang_vel_xy_l2"), 0.25)
        np.testing.assert_allclose(said(env, "base_height_l2", share=0.9), (0.25 / HEIGHT - 0.9) ** 2)
        assert said(env, "base_sunk", "predicate", share=0.8) == 1.0
        assert said(env, "base_sunk", "predicate", share=0.7) == 0.0
        put(env, pitch=0.3)
        np.testing.assert_allclose(said(env, "flat_orientation_l2"), np.sin(0.3) ** 2, rtol=1e-6)


def test_joints_away_from_home() -> None:
    with dog() as env:
        env.reset(seed=0)
        env.engine.set_joint_state(
            np.full((1, 2), 0.2), None, None, [env.engine.index.joint(f"dog.{n}") for n in JOINTS]
        )
        env.scene.look(None)
        np.testing.assert_allclose(said(env, "joint_deviation_l2", joints="hips"), 0.04)
        np.testing.assert_allclose(said(env, "joint_deviation_l2"), 0.04 + 0.36)
        with pytest.raises(TaskError, match="no joint of 'dog' is 'hip'"):
            said(env, "joint_deviation_l2", joints="hip")


JOINTS = ("FL_hip_joint", "FR_thigh_joint")


def test_efforts_are_shares_of_their_limits() -> None:
    require_engine("mujoco")
    with dog(engine="mujoco") as env:
        env.reset(seed=0)
        env.step(np.full((1, 12), 0.5))
        limits = np.array([drive.effort_limit for drive in env.engine.world.actuators])
        effort = env.engine.get_state().joint_effort[0]
        assert (np.abs(effort) > 0.1).any()
        np.testing.assert_allclose(said(env, "effort_share_l2"), ((effort / limits) ** 2).sum())


def test_a_sum_of_rewards_is_no_less_than_its_bound() -> None:
    with dog() as env:
        env.reset(seed=0)
        costly = {"alive": {"weight": 1.0}, "walk": {"term": "action_l2", "weight": -0.5}}
        for action, total in ((0.0, 1.0), (0.25, 1.0 - 0.5 * 12 * 0.0625), (1.0, 0.0)):
            env.scene.last_action = np.full((1, 12), action)
            np.testing.assert_allclose(said(env, "at_least", of=costly), total)


def test_a_share_of_the_commands_is_zero_and_one_is_straight() -> None:
    walk = {
        "term": "tasks.velocity",
        "forward": {"range": [0.5, 1.0]},
        "turn": {"range": [0.5, 1.0]},
        "still": 0.1,
        "straight": 0.25,
    }
    with dog(400, task={**DOG["task"], "command": {"walk": walk}}) as env:
        env.reset(seed=0)
        goal = env.scene.goals["walk"]
        still, straight = (goal == 0.0).all(axis=1), (goal[:, 0] != 0.0) & (goal[:, 2] == 0.0)
        assert 20 <= still.sum() <= 60
        assert 70 <= straight.sum() <= 130
        assert (goal[~still & ~straight] > 0.4).sum() == 2 * (~still & ~straight).sum()


def test_a_base_that_moves_as_told_has_tracked_its_command() -> None:
    with dog(2) as env:
        env.reset(seed=0)
        tracked = bind("predicate", "tasks.tracked", {"goal": "walk", "after": 1.5, "speed": 0.1}, env.scene, "t")
        root = env.engine.index.entity("dog").root
        for step in range(1, 80):
            env.scene.elapsed[:] = step
            speed = np.array([[0.5, 0, 0, 0, 0, 0], [0.7 if step > 60 else 0.5, 0, 0, 0, 0, 0]])
            if step <= 50:
                speed[:] = 0.0  # it has yet to begin, which does not count
            env.engine.set_body_state(None, speed[:, None], None, [root])
            env.scene.look(None)
            now = tracked().tolist()
            assert step >= 75 or now == [False, False]
        assert now == [True, False]


def test_a_shove_comes_at_its_time_and_is_of_its_size() -> None:
    shove = {"term": "tasks.shove", "when": "step", "velocity": [0.4, -0.2, 0.0], "every": 0.1}
    with dog(2, task={**DOG["task"], "events": {"shove": shove}}) as env:
        env.reset(seed=0)
        root = env.engine.index.entity("dog").root
        speeds = []
        for _ in range(6):
            env.step(np.zeros((2, 12)))
            speeds.append(env.engine.get_state().body_twist[:, root, :3].copy())
        gained = np.diff(speeds, axis=0)
        np.testing.assert_allclose(gained[3], [[0.4, -0.2, 0.0]] * 2, atol=1e-6)
        assert (np.abs(np.delete(gained, 3, axis=0)) < 1e-9).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_centre_of_mass_is_elsewhere_for_an_episode(engine: str) -> None:
    require_engine(engine)
    com = {"term": "tasks.com_offset", "offset": {"range": [[-0.03, 0.0, 0.0], [0.03, 0.0, 0.0]]}}
    with dog(2, engine=engine, task={**DOG["task"], "events": {"com": com}}) as env:
        env.reset(seed=0)
        root = env.engine.index.entity("dog").root
        built = np.array(env.engine.world.bodies[root].inertial.com)
        apart = env.engine.get_parameters("body.com", None, [root])[:, 0] - built
        assert (np.abs(apart[:, 0]) > 1e-4).all()
        np.testing.assert_allclose(apart[:, 1:], 0.0, atol=1e-9)
        assert apart[0, 0] != apart[1, 0]


def test_a_robot_begins_tipped_over() -> None:
    tip = {"term": "tasks.tip_over", "roll": {"range": [0.5, 1.0]}, "pitch": 0.0, "lift": 0.1}
    with dog(3, task={**DOG["task"], "events": {"tip": tip}}) as env:
        env.reset(seed=0)
        pose = env.scene.frame("dog").pose
        np.testing.assert_allclose(pose[:, 2], HEIGHT + 0.1, atol=1e-6)
        rolls = 2.0 * np.arctan2(pose[:, 3], pose[:, 6])
        assert ((rolls >= 0.5) & (rolls <= 1.0)).all()
        assert len(set(rolls.tolist())) == 3


def test_what_has_no_legs_has_no_feet() -> None:
    arm = {**DOG["world"], "robots": {"arm": {"robot": "franka_panda", "actions": {"arm": "joint_position"}}}}
    task = {"observations": {"policy": ["joint_pos"]}}
    with anysim.make({**DOG, "world": arm, "task": task}) as env:
        env.reset(seed=0)
        with pytest.raises(TaskError, match=r"'arm' \(franka_panda\) has no `legs` in the catalogue"):
            said(env, "feet_slide")
