"""Quadrupeds of the catalogue on a plane, for tests and benchmarks: worlds, and walks that are measured."""

from typing import Any, NamedTuple

import numpy as np

import anysim
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv

QUADRUPEDS = (
    "unitree_go1",
    "unitree_a1",
    "unitree_go2",
    "unitree_b1",
    "laikago",
    "anymal_b",
    "anymal_c",
    "hyq",
    "solo12",
)
WITH_ARM = {"b1_z1": {"arm": "joint_position", "eef": "gripper_binary"}, "anymal_kinova": {"arm": "joint_position"}}
"""Quadrupeds with an arm, and what drives the rest of them while they walk."""
TILT = np.deg2rad(60.0)


def spec(robot: str, engine: str, base: Any = "default", **physics: Any) -> dict[str, Any]:
    """A robot alone on a plane, 50 Hz control and 2 ms steps."""
    return {
        "engine": engine,
        "physics": {"dt": 0.002, "control_dt": 0.02, **physics},
        "world": {
            "terrain": "plane",
            "robots": {"robot": {"robot": robot, "actions": {"base": base, **WITH_ARM.get(robot, {})}}},
        },
        "task": {"horizon": 100_000, "observations": {"policy": [{"term": "frame_pose", "frame": "robot"}]}},
    }


def stand(env: TaskEnv) -> Array:
    """The action (N, A) that asks nothing of the base and holds the rest at home, the gripper open."""
    parts = []
    for s in env.actions.slices:
        channel = s.controller.channel
        home = channel.robot.kinematics.initial[channel.joint_columns]
        if s.channel == "base" and s.controller.dim == 3:
            home = np.zeros(3)
        parts.append(np.ones(1) if channel.opened is not None else home)
    return np.tile(np.concatenate(parts), (env.num_envs, 1))


class Walk(NamedTuple):
    """How envs (N) walked."""

    velocity: Array
    """(N, 3) mean over the last 60 % [m/s, m/s, rad/s], in the heading frame"""
    place: Array
    """(N, 3) at the end [m], from where it began"""
    fell: Array
    """(N,) bool: tilted by more than 60 degrees, or the base below half of its height"""
    tilt: Array
    """(N,) the largest [rad]"""


def walk(env: TaskEnv, commands: Array, seconds: float) -> Walk:
    """Walk with commands (N, 3) for the base, from a reset on."""
    env.reset(seed=0)
    robot = env.actions.slices[0].controller.robot
    action = stand(env)
    action[:, :3] = commands
    count = round(seconds / 0.02)
    poses, speeds = np.empty((count + 1, env.num_envs, 7)), np.empty((count, env.num_envs, 3))
    poses[0] = env.engine.get_state().body_pose[:, robot.root]
    for k in range(count):
        env.step(action)
        state = env.engine.get_state()
        poses[k + 1] = state.body_pose[:, robot.root]
        ahead = P.rotate(poses[k + 1, :, 3:], np.tile([1.0, 0.0, 0.0], (env.num_envs, 1)))
        yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
        vx, vy = state.body_twist[:, robot.root, 0], state.body_twist[:, robot.root, 1]
        turn = state.body_twist[:, robot.root, 5]
        speeds[k] = np.stack([np.cos(yaw) * vx + np.sin(yaw) * vy, np.cos(yaw) * vy - np.sin(yaw) * vx, turn], axis=1)
    up = P.rotate(poses[..., 3:], np.broadcast_to([0.0, 0.0, 1.0], (*poses.shape[:2], 3)))[..., 2]
    tilt = np.arccos(np.clip(up, -1.0, 1.0)).max(axis=0)
    fell = (tilt > TILT) | (poses[..., 2].min(axis=0) < 0.5 * robot.entry.base_height)
    return Walk(speeds[int(0.4 * count) :].mean(axis=0), poses[-1, :, :3] - poses[0, :, :3], fell, tilt)


def made(robot: str, engine: str, num_envs: int, base: Any = "default", **physics: Any) -> TaskEnv:
    """The env of `spec`."""
    return anysim.make(spec(robot, engine, base, **physics), num_envs=num_envs)
