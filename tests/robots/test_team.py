"""The team of docs/worlds: five kinds of robot in one file, on every engine, for two seconds; in 16 envs, often 2."""

from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.api import load
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from tests.runtime.light import REAL

WORLD = Path(__file__).parents[2] / "docs" / "worlds" / "team.yaml"
ENVS = 16


def team(engine: str, num_envs: int) -> TaskEnv:
    spec = load(WORLD).spec.to_dict() | {
        "engine": engine,
        "task": {"horizon": 10**6, "observations": {"policy": [{"term": "joint_pos", "robot": "panda"}]}},
        "record": {"cameras": []},
    }
    return anysim.make(spec, num_envs=num_envs)


def neutral(env: TaskEnv) -> np.ndarray:
    """What asks for nothing: where joints are commanded, the places that they have; else zero."""
    action = np.zeros((env.num_envs, env.action_dim))
    everyone = np.arange(env.num_envs)
    targets = env.engine.control.position
    for s in env.actions.slices:
        try:
            action[:, s.start : s.stop] = s.controller.action_for(targets[:, s.controller.channel.actuators], everyone)
        except TaskError:
            pass  # not asked for joint positions: zero
    return action


def up(env: TaskEnv, name: str) -> np.ndarray:
    """How far a robot's z axis points up (N,)."""
    turn = env.scene.frame(name).quaternion
    return P.rotate(turn, np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(turn), 3)))[:, 2]


@pytest.mark.parametrize(
    ("engine", "num_envs"),
    [
        *(pytest.param(e, 2, marks=pytest.mark.slow) for e in REAL if e != "pybullet"),
        *(pytest.param(e, ENVS, marks=pytest.mark.full) for e in REAL),
    ],
)
def test_no_robot_falls(engine: str, num_envs: int) -> None:
    with team(engine, num_envs) as env:
        assert list(env.action_spaces) == [
            "panda.arm",
            "panda.eef",
            "rover.base",
            "rover.arm",
            "dog.base",
            "human.base",
            "human.arm",
            "cam.base",
            "cam.arm",
        ]
        env.reset(seed=0)
        action = neutral(env)
        robots = ("panda", "rover", "dog", "human", "cam")
        before = {name: env.scene.frame(name).pose.copy() for name in robots}
        for _ in range(60):
            result = env.step(action)
            assert not result.info["fault"].any()
            assert (result.status == "running").all()
        for name in robots:
            moved = env.scene.frame(name).position - before[name][:, :3]
            assert up(env, name).min() > 0.95, f"{name} has fallen"
            assert np.abs(moved[:, 2]).max() < 0.06, f"{name} has sunk or risen"
            assert P.norm(moved[:, :2]).max() < 0.25, f"{name} has wandered off"
        ahead = P.rotate(env.scene.frame("cam.camera").quaternion, np.tile([0.0, 0.0, 1.0], (num_envs, 1)))
        way = env.scene.frame("human").position - env.scene.frame("cam.camera").position
        assert (P.dot(ahead, way) / P.norm(way)).min() > np.cos(0.05), "the camera looks at the humanoid"
