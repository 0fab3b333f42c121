"""A policy from a file turns a bar with the fingers of a hand; what it is told, and how it fails."""

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
import yaml
from onnx import TensorProto, helper, numpy_helper

from anysim import make
from anysim.errors import TaskError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine

WORLD = Path(__file__).parent / "worlds/in_hand.yaml"
PUSHING = ("joint_9.0", "joint_1.0")
"""The knuckles of the ring finger and of the index: they push the bar's ends."""
JOINTS = [*PUSHING, *(f"joint_{k}.0" for k in range(16) if f"joint_{k}.0" not in PUSHING)]


def policy(folder: Path, **changes: Any) -> str:
    """relu(x W): the turn that is left closes the ring finger, its opposite the index."""
    weights = np.zeros((17, 16), dtype=np.float32)
    weights[0, :2] = 1.0, -1.0
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["x", "W"], ["h"]), helper.make_node("Relu", ["h"], ["y"])],
        "turn",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", 17])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", 16])],
        [numpy_helper.from_array(weights, "W")],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), folder / "turn.onnx")
    spec = {
        "model": "turn.onnx",
        "joints": JOINTS,
        "observations": [{"term": "command", "scale": 10.0}, "joint_pos"],
        "commands": [{"name": "turn_z", "low": -1.0, "high": 1.0}],
        "action_scale": 1.0,
        **changes,
    }
    file = folder / "turn.yaml"
    file.write_text(yaml.safe_dump(spec))
    return f"task.expert.options={{file: {file}}}"


def turned(env: TaskEnv) -> Outcome:
    """The outcome in the first env."""
    env.reset(seed=11)
    skilled, everyone = SkillPolicy(env), np.arange(env.num_envs)
    skilled.begin(everyone)
    while env.running.all() and not skilled.skill.outcome.all():
        env.step(skilled.act(everyone))
    return OUTCOMES[skilled.skill.outcome[0]]


SLOW = pytest.mark.slow


@pytest.mark.parametrize("engine", ["mujoco", pytest.param("pybullet", marks=SLOW), pytest.param("sapien", marks=SLOW)])
@pytest.mark.parametrize("yaw", [0.3, -0.3])
def test_the_bar_is_turned_to_the_goal(engine: str, yaw: float, tmp_path: Path) -> None:
    require_engine(engine)
    goal = f"world.layout.goal={{position: [0.1, 0.0, 0.01], yaw: {yaw}, checked: false}}"
    with make(WORLD, engine=engine, overrides=[policy(tmp_path), goal]) as env:
        assert turned(env) is Outcome.OK
        env.scene.look(None)
        assert P.yaw(env.scene.frame("bar").quaternion)[0] == pytest.approx(yaw, abs=0.1)


def test_a_bar_that_is_gone_is_lost(tmp_path: Path) -> None:
    away = "world.layout.bar={position: [0.6, 0.0, 0.025]}"
    with make(WORLD, engine="mujoco", overrides=[policy(tmp_path), away]) as env:
        assert turned(env) is Outcome.LOST


def test_a_policy_that_does_nothing_is_late(tmp_path: Path) -> None:
    still = policy(tmp_path, action_scale=1e-6)
    with make(WORLD, engine="mujoco", overrides=[still, "task.expert.steps=40"]) as env:
        assert turned(env) is Outcome.TIMEOUT


def test_a_policy_that_wants_to_know_more_is_refused(tmp_path: Path) -> None:
    more = policy(tmp_path, commands=[{"name": "turn_w", "low": -1.0, "high": 1.0}])
    with (
        make(WORLD, engine="mujoco", overrides=[more]) as env,
        pytest.raises(TaskError, match=r"told 'turn_w'.* which this skill does not give \(features: turn_x, "),
    ):
        SkillPolicy(env)


def test_a_policy_of_another_rate_is_refused(tmp_path: Path) -> None:
    with (
        make(WORLD, engine="mujoco", overrides=[policy(tmp_path, period=0.01)]) as env,
        pytest.raises(TaskError, match=r"each control step of 0\.02 s, this one has .* a period of 0\.01 s"),
    ):
        SkillPolicy(env)
