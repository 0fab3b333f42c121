"""Observation terms of a robot: against poses and twists that were set, and against the frames' own terms."""

from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.terms import observations as terms
from tests.task.helpers import arm

GO1: dict[str, Any] = {
    "engine": "null",
    "world": {
        "name": "dog",
        "robots": {"dog": {"robot": "unitree_go1", "position": [0, 0, 0.4], "actions": {"base": "joint_velocity"}}},
    },
    "task": {
        "horizon": 50,
        "observations": {
            "policy": ["base_pose", "base_lin_vel", "base_ang_vel", "projected_gravity",
                       {"term": "commanded_velocity"}, {"term": "channel_action", "channel": "base"}],
        },
    },
}  # fmt: skip
TILT = P.from_roll_pitch_yaw(np.array([[0.3, -0.2, 1.0], [0.0, 0.0, -2.0]]))


def tilted(env: TaskEnv) -> None:
    """Put both dogs somewhere, moving."""
    env.reset(seed=0)
    root = env.engine.index.entity("dog").root
    pose = np.concatenate([[[1.0, 2.0, 0.5], [0.0, 0.0, 0.4]], TILT], axis=1)[:, None]
    twist = np.array([[0.5, 0.0, 0.1, 0.0, 0.0, 2.0], [0.0, -1.0, 0.0, 0.3, 0.0, 0.0]])[:, None]
    env.engine.set_body_state(pose, twist, None, [root])
    env.scene.look(None)


def test_the_base_is_seen_in_its_own_axes() -> None:
    with anysim.make(GO1, num_envs=2) as env:
        tilted(env)
        robot, scene = env.scene.robot("dog"), env.scene
        turn = P.to_matrix(TILT)
        linear, rate = np.array([[0.5, 0, 0.1], [0, -1, 0]]), np.array([[0, 0, 2.0], [0.3, 0, 0]])
        for row in range(2):
            inverse = turn[row].T
            assert np.allclose(terms.base_lin_vel(scene, robot=robot)[row], inverse @ linear[row])
            assert np.allclose(terms.base_ang_vel(scene, robot=robot)[row], inverse @ rate[row])
            assert np.allclose(terms.projected_gravity(scene, robot=robot)[row], inverse @ [0, 0, -1])
        assert np.allclose(terms.base_pose(scene, robot=robot)[:, :3], [[1, 2, 0.5], [0, 0, 0.4]])
        assert (terms.base_pose(scene, robot=robot)[:, 6] >= 0).all()
        assert np.allclose(terms.projected_gravity(scene, robot=robot)[1], [0, 0, -1]), "yaw does not tilt"


def test_commands_and_actions_of_a_channel_are_seen() -> None:
    with anysim.make(GO1, num_envs=2) as env:
        obs, _ = env.reset(seed=0)
        k = env.action_dim
        assert not obs["policy"][:, -2 * k :].any()
        action = np.linspace(-1.0, 1.0, 2 * k).reshape(2, k)
        seen = env.step(action).obs["policy"]
        assert np.allclose(seen[:, -2 * k : -k], action, atol=1e-6)
        assert np.allclose(seen[:, -k:], action, atol=1e-6)


def test_the_tool_from_the_world_and_from_the_base() -> None:
    with arm(2, "world.robots.panda.yaw=0.7", "world.robots.panda.position=[0.2, -0.1, 0.4]") as env:
        env.reset(seed=1)
        for _ in range(3):
            env.step(np.random.default_rng(0).uniform(-1, 1, (2, env.action_dim)))
        scene, robot = env.scene, env.scene.robot("panda")
        world = terms.tool_pose(scene, robot=robot)
        own = terms.tool_pose(scene, robot=robot, frame="base")
        base = P.pose((0.2, -0.1, 0.4), tuple(P.from_roll_pitch_yaw(np.array([0, 0, 0.7]))))
        back = P.compose(np.broadcast_to(base, own.shape), own)
        assert np.allclose(back[:, :3], world[:, :3])
        assert np.allclose(P.angle_between(back[:, 3:], world[:, 3:]), 0, atol=1e-7)
        twist, seen = (terms.tool_twist(scene, robot=robot, frame=f) for f in ("world", "base"))
        assert np.abs(twist).max() > 1e-3
        turn = np.broadcast_to(base[3:], (2, 4))
        assert np.allclose(P.rotate(turn, seen[:, :3]), twist[:, :3])
        assert np.allclose(P.rotate(turn, seen[:, 3:]), twist[:, 3:])


def test_what_turns_with_the_base_has_no_twist_in_it() -> None:
    spec = {**GO1, "world": {**GO1["world"]}}
    with anysim.make(spec, num_envs=2) as env:
        tilted(env)
        robot, scene = env.scene.robot("dog"), env.scene
        assert np.allclose(terms.tool_twist(scene, robot=robot, tool="FL_hip", frame="base"), 0.0, atol=1e-12)
        assert np.abs(terms.tool_twist(scene, robot=robot, tool="FL_hip")).max() > 0.1


def test_joints_of_a_channel_relative_to_home() -> None:
    with arm(2) as env:
        env.reset(seed=1)
        scene, robot = env.scene, env.scene.robot("panda")
        whole = terms.joint_pos(scene, robot=robot)
        home = np.array([j.initial for j in env.engine.world.joints if j.name.startswith("panda.")])
        assert np.allclose(terms.channel_joint_pos(scene, robot=robot), (whole - home)[:, :7])
        assert np.allclose(terms.channel_joint_pos(scene, robot=robot, channel="eef", relative="zero"), whole[:, 7:])
        assert terms.channel_joint_vel(scene, robot=robot).shape == (2, 7)


def test_delay_and_noise_apply_to_them() -> None:
    late = "task.observations.policy=[{term: tool_pose, delay: 2}, {term: channel_action, noise: 0.1}]"
    with arm(2, late) as env:
        first = env.reset(seed=0)[0]["policy"]
        seen = [env.step(np.full((2, env.action_dim), 0.5)).obs["policy"] for _ in range(4)]
        assert np.array_equal(seen[1][:, :7], first[:, :7])
        assert not np.array_equal(seen[2][:, :7], first[:, :7])
        assert np.allclose(seen[3][:, 7:], 0.6)


@pytest.mark.parametrize(
    ("terms_", "words"),
    [
        ("[{term: tool_pose, tool: tol}]", "'panda' has no link or tool 'tol'"),
        ("[{term: tool_pose, frame: bas}]", "expected one of world, base"),
        ("[{term: channel_joint_pos, channel: am}]", "no channel 'am'.*arm"),
        ("[{term: commanded_velocity}]", "no channel 'base'"),
    ],
)
def test_what_does_not_exist_is_said_when_the_env_is_built(terms_: str, words: str) -> None:
    with pytest.raises(AnysimError, match=words):
        arm(1, f"task.observations.policy={terms_}")


def test_a_channel_without_a_controller_has_no_action() -> None:
    mute = {**GO1["world"], "robots": {"arm": {"robot": "franka_panda", "actions": {"eef": "gripper_binary"}}}}
    task = {"horizon": 5, "observations": {"policy": ["channel_action"]}}
    with pytest.raises(AnysimError, match=r"'arm.arm' has no controller.*channels with one: arm.eef"):
        anysim.make({**GO1, "world": mute, "task": task})


def test_targets_and_the_width_of_a_gripper() -> None:
    with arm(2) as env:
        env.reset(seed=1)
        scene, robot = env.scene, env.scene.robot("panda")
        for opening in (-1.0, 1.0):
            action = np.zeros((2, env.action_dim))
            action[:, -1] = opening
            for _ in range(40):
                env.step(action)
            width = terms.gripper_width(scene, robot=robot)
            np.testing.assert_allclose(width, 0.08 * (opening > 0), atol=1e-3)
            target = terms.commanded_position(scene, robot=robot, channel="eef")
            np.testing.assert_allclose(target, env.engine.control.position[:, 7 : 7 + target.shape[1]])
            assert ((target > 0.03) == (opening > 0)).all()
        assert np.allclose(
            terms.commanded_position(scene, robot=robot),
            terms.channel_joint_pos(scene, robot=robot, relative="zero"),
            atol=0.05,
        )
        with pytest.raises(AnysimError, match=r"'panda.arm' is no gripper.*grippers: eef"):
            terms.gripper_width(scene, robot=robot, channel="arm")
