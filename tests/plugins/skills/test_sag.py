"""Sag of an arm that carries its own weight, as skills make up for it."""

import numpy as np
import pytest

import anysim
from anysim.math import pose as P
from anysim.testing.engines import require_engine
from anysim_skills.arm import Arm
from anysim_skills.sag import MOST, Sag
from tests.tasks.states import blinding


@pytest.mark.parametrize(("task", "robot", "sags"), [("loco_grasp", "dog", True), ("pick_cube", "panda", False)])
def test_an_arm_that_carries_itself_gets_to_its_target(task: str, robot: str, sags: bool) -> None:
    """The Z1 would stay 1 cm below it; an arm whose weight is cancelled is told nothing but its target."""
    require_engine("mujoco")
    with anysim.make(task, engine="mujoco", num_envs=1, overrides=blinding(task)) as env:
        env.reset(seed=2)
        ids, tool = np.arange(1), "between" if sags else "tool"
        arm = Arm.of(env, env.scene.robot(robot), tool=tool)
        env.scene.look(None)
        arm.prepare(ids)
        target = arm.tool.pose + np.array([0.0, 0.0, -0.05, 0.0, 0.0, 0.0, 0.0])
        arm.go(ids, target, 0.2)
        action = np.zeros((1, env.action_dim))
        for _ in range(120):
            env.scene.look(None)
            arm.act(ids, action)
            env.step(action)
        env.scene.look(None)
        missing = P.norm(arm.tool.position - target[:, :3])
    assert missing < 0.004
    assert (arm._sag is not None) == sags
    assert not sags or P.norm(arm._sag.offset)[0] > 0.004


def test_what_is_made_up_for_is_bounded_and_forgotten() -> None:
    sag = Sag(2, control_dt=0.02)
    for _ in range(200):
        sag.learn(np.array([1]), np.array([[0.0, 0.0, 0.05]]))
    assert sag.offset.tolist()[0] == [0.0, 0.0, 0.0]
    np.testing.assert_allclose(sag.offset[1], [0.0, 0.0, MOST])
    sag.forget(np.array([1]))
    assert not sag.offset.any()
