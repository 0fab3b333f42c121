"""Put into containers, throw switches; and names that mean the same command."""

import numpy as np
import pytest

from anysim import make, registry
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_pick import rollout

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
SAME = {"goto": "navigate", "place_on": "place", "push_to": "push", "drag_to": "drag", "pour_into": "pour"}


@pytest.mark.parametrize("engine", ENGINES)
def test_things_are_put_into_a_bin(engine: str) -> None:
    require_engine(engine)
    things = "{do: grasp, object: bar}, {do: place_in, object: bar, target: bin}"
    changes = ["record.cameras=[]", "task.on_success=continue", f"collect={{commands: [{things}]}}"]
    with make("tidy_bin", engine=engine, num_envs=2, overrides=changes) as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        rollout(env, policy, 600)
        assert [OUTCOMES[o] for o in policy.skill.outcome] == [Outcome.OK] * 2
        pose, index = env.engine.get_state().body_pose, env.engine.index
        away = pose[:, index.body("bar"), :3] - pose[:, index.body("bin"), :3]
        assert (np.abs(away[:, :2]) < 0.05).all()
        assert (away[:, 2] < 0.04).all(), "on its floor"


def test_what_does_not_come_to_lie_in_the_container_is_lost() -> None:
    """A bar that is longer than the bin is wide lies on its rim."""
    things = "{do: grasp, object: bar, offset: [0, 0, 0]}, {do: place_in, object: bar, target: bin}"
    sizes = ["world.objects.bar.source.box=[0.4, 0.03, 0.03]", "world.objects.bin.source.params.size=[0.1, 0.1, 0.06]"]
    places = ["world.layout.bar={on: table, x: 0.35, y: -0.2}"]
    changes = ["record.cameras=[]", "task.on_success=continue", *sizes, *places, f"collect={{commands: [{things}]}}"]
    with make("tidy_bin", engine="mujoco", overrides=changes) as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        rollout(env, policy, 600)
        assert OUTCOMES[policy.skill.outcome[0]] is Outcome.LOST


@pytest.mark.parametrize("engine", ENGINES)
def test_a_switch_is_thrown_on_and_off_again(engine: str) -> None:
    require_engine(engine)
    commands = "{do: flip, part: switch.rocker}, {do: flip, part: switch.rocker, on: false}"
    changes = ["record.cameras=[]", "task.on_success=continue", f"collect={{commands: [{commands}]}}"]
    with make("flip_switch", engine=engine, num_envs=2, overrides=changes) as env:
        env.reset(seed=1)
        policy, joint = SkillPolicy(env), [j.name for j in env.engine.world.joints].index("switch.rocker")
        everyone, furthest = np.arange(2), np.zeros(2)
        policy.begin(everyone)
        for _ in range(399):
            env.step(policy.act(everyone))
            furthest = np.maximum(furthest, env.engine.get_state().joint_pos[:, joint])
        upper = env.engine.world.joints[joint].upper
        assert (furthest > 0.9 * upper).all()
        assert (env.engine.get_state().joint_pos[:, joint] < 0.1 * upper).all()
        assert [OUTCOMES[o] for o in policy.skill.outcome] == [Outcome.OK] * 2


@pytest.mark.parametrize("name", SAME)
def test_two_names_are_one_command(name: str) -> None:
    assert registry.load("skills", name) is registry.load("skills", SAME[name])
