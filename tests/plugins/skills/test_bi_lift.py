"""Two arms lift a beam in step, and neither begins where the other does not reach."""

from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine

WORLD = Path(__file__).parent / "worlds/bi_lift.yaml"


def beam(env: TaskEnv) -> Array:
    env.scene.look(None)
    return env.scene.frame("beam").pose.copy()


def run(env: TaskEnv, dropped: bool = False) -> tuple[SkillPolicy, float]:
    """Until the skill has ended everywhere; the largest tilt [rad] of the beam. `dropped`: it falls on the way."""
    env.reset(seed=11)
    policy, everyone, most = SkillPolicy(env), np.arange(env.num_envs), 0.0
    policy.begin(everyone)
    home = beam(env)
    while env.running.all() and not policy.skill.outcome.all():
        env.step(policy.act(everyone))
        if dropped and beam(env)[0, 2] - home[0, 2] > 0.05:
            body = env.engine.index.entity("beam").root
            env.engine.set_body_state(home[:, None], np.zeros((env.num_envs, 1, 6)), None, [body])
            continue
        up = P.rotate(beam(env)[:, 3:], np.tile([0.0, 0.0, 1.0], (env.num_envs, 1)))
        most = max(most, float(np.arccos(np.minimum(up[:, 2], 1.0)).max()))
    return policy, most


def lifted(engine: str, num_envs: int) -> None:
    require_engine(engine)
    with make(WORLD, engine=engine, num_envs=num_envs, overrides=["task.on_success=continue"]) as env:
        policy, most = run(env)
        assert [OUTCOMES[o] for o in policy.skill.outcome] == [Outcome.OK] * num_envs
        assert most < 0.06
        assert (beam(env)[:, 2] > 0.53).all()


def test_a_beam_is_lifted_level() -> None:
    lifted("mujoco", 4)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_a_beam_is_lifted_level_on_the_other_engines(engine: str) -> None:
    lifted(engine, 4)


def test_what_one_arm_does_not_reach_is_no_ik_for_both() -> None:
    near = "world.layout.beam={on: table, x: 0.15, y: 0.45, yaw: 1.5708}"
    with make(WORLD, engine="mujoco", num_envs=1, overrides=[near]) as env:
        policy, _ = run(env)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.NO_IK


@pytest.mark.slow
def test_a_beam_that_is_lost_on_the_way_up_is_tried_again() -> None:
    with make(WORLD, engine="mujoco", num_envs=1, overrides=["task.horizon=3000"]) as env:
        policy, _ = run(env, dropped=True)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.UNSTABLE_GRASP
        tried = ("back_off", "recover", "give up")
        assert policy.describe(0)["ladder"] == [f"unstable_grasp -> {rung}" for rung in tried]
