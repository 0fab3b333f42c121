"""A hand with four fingers closes on a bottle, finger by finger, and lifts it."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.errors import TaskError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.grasping.dex_grasp import DexGrasp
from tests.plugins.skills.test_pick import rollout

WORLD = Path(__file__).parent / "worlds/dex_grasp.yaml"
CLOSE, LIFT = 5, 6


def lifting(engine: str, num_envs: int, *overrides: str) -> TaskEnv:
    require_engine(engine)
    return make(WORLD, engine=engine, num_envs=num_envs, overrides=overrides)


def test_a_bottle_is_lifted() -> None:
    with lifting("mujoco", 4) as env:
        env.reset(seed=11)
        policy = SkillPolicy(env)
        assert rollout(env, policy, 500) == ["success"] * 4
        assert isinstance(policy.skill, DexGrasp)
        env.scene.look(None)
        forces, links = policy.skill.hand.touches(np.arange(4))
        assert (links >= 3).all()
        assert (forces[:, -1] > 0.5).all(), "the thumb is one of them"


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_a_bottle_is_lifted_on_the_other_engines(engine: str) -> None:
    with lifting(engine, 4) as env:
        env.reset(seed=11)
        assert rollout(env, SkillPolicy(env), 500).count("success") >= 3


def test_each_finger_stops_where_it_touches() -> None:
    """Beside a thin bottle the fingers go on to the end, around a thick one they stop before, and press a little."""
    ends = {}
    for radius in (0.02, 0.035):
        thick = f"world.objects.bottle.source={{cylinder: [{radius}, 0.26]}}"
        with lifting("mujoco", 1, thick) as env:
            env.reset(seed=11)
            policy, one = SkillPolicy(env), np.array([0])
            policy.begin(one)
            assert isinstance(policy.skill, DexGrasp)
            hand = policy.skill.hand
            while policy.skill.phase[0] < LIFT:
                open_before = hand.s[0].copy()
                env.step(policy.act(one))
                assert (hand.s[0] >= open_before).all()
            assert hand.stopped.all()
            ends[radius] = hand.s[0].copy()
    assert ends[0.035].max() <= 1.0
    assert (ends[0.035] < ends[0.02]).any()
    assert (ends[0.035] <= ends[0.02]).all()


def test_a_bottle_out_of_reach_is_no_ik() -> None:
    with lifting("mujoco", 1, "world.layout.bottle={on: terrain, x: 1.3, y: 0.0}") as env:
        env.reset(seed=11)
        policy = SkillPolicy(env)
        rollout(env, policy, 400)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK


def test_a_bottle_that_is_gone_when_the_hand_closes_is_missed() -> None:
    with lifting("mujoco", 1, "task.horizon=3000") as env:
        env.reset(seed=11)
        policy, one = SkillPolicy(env), np.array([0])
        policy.begin(one)
        away = np.array([[[3.0, 3.0, 0.13, 0.0, 0.0, 0.0, 1.0]]])
        while not policy.skill.outcome[0]:
            env.step(policy.act(one))
            if policy.skill.phase[0] == CLOSE and policy.skill.steps[0] == 1:
                env.engine.set_body_state(away, np.zeros((1, 1, 6)), None, [env.engine.index.entity("bottle").root])
        assert policy.describe(0)["ladder"] == ["missed_contact -> back_off", "no_ik -> recover", "no_ik -> give up"]


def test_a_gripper_without_fingers_is_refused() -> None:
    gripper = [
        "world.robots.robot={robot: franka_panda, actions: {arm: joint_position, eef: gripper_binary}}",
        "world.robots.robot.actions.eef.params={}",
    ]
    with (
        lifting("mujoco", 1, *gripper) as env,
        pytest.raises(TaskError, match=r"channel 'eef' of 'robot' has no fingers in the catalogue"),
    ):
        SkillPolicy(env)


def test_a_hand_around_another_bottle_holds_the_wrong_one() -> None:
    other = (
        "world.objects.other={source: {cylinder: [0.03, 0.26]}, mass: 0.2, friction: 0.9}",
        "world.layout.other={on: terrain, x: 0.5, y: 0.5}",
    )
    with lifting("mujoco", 1, "task.horizon=3000", *other) as env:
        env.reset(seed=11)
        policy, one = SkillPolicy(env), np.array([0])
        policy.begin(one)
        bodies = [env.engine.index.entity(name).root for name in ("bottle", "other")]
        left = 1
        while env.running[0] and not policy.skill.outcome[0]:
            env.step(policy.act(one))
            if left and policy.skill.phase[0] == CLOSE and policy.skill.steps[0] == 1:
                left -= 1
                here = env.engine.get_state().body_pose[:, bodies].copy()
                env.engine.set_body_state(here[:, ::-1], np.zeros((1, 2, 6)), None, bodies)
        assert policy.skill.history(0)[0] == ("wrong_object", "back_off")
