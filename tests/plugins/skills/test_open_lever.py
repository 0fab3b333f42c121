"""The skill open on a door with a lever: turned, off the latch, let up, open; and what it says where that fails."""

import numpy as np
import pytest

from anysim import make
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_engine
from tests.plugins.skills.test_manipulation import WORLDS, solved
from tests.tiers import others

WORLD = "open_lever_door"


def test_a_latched_door_is_opened_by_its_lever() -> None:
    assert solved(WORLD, "mujoco", 4) == 1.0


@pytest.mark.parametrize("engine", others("pybullet"))
def test_it_is_opened_on_the_other_engines(engine: str) -> None:
    assert solved(WORLD, engine, 4) >= 0.75


def test_the_lever_is_level_again_before_the_hand_leaves() -> None:
    require_engine("mujoco")
    with make(WORLDS / f"{WORLD}.yaml", engine="mujoco") as env:
        env.reset(seed=3)
        policy, one = SkillPolicy(env), np.arange(1)
        policy.begin(one)
        leaf, lever = (env.engine.index.joint(f"door.{name}") for name in ("leaf", "lever"))
        at: dict[str, tuple[float, float]] = {}
        for _ in range(700):
            action = policy.act(one)
            leaf_now, lever_now = env.engine.get_state().joint_pos[0, [leaf, lever]]
            at[str(policy.skill.describe(0)["phase"])] = (float(leaf_now), float(lever_now))
            if env.step(action).status[0] != "running":
                break
    assert list(at)[list(at).index("close") :] == ["close", "turn", "draw", "let up", "pull", "retreat"]
    assert at["turn"][1] > 0.4363, "the bolt was drawn"
    assert at["turn"][0] < 0.05
    assert at["let up"][1] < 0.1
    assert at["pull"][0] > 0.4


@pytest.mark.parametrize(
    ("override", "outcome"),
    [
        ("world.objects.door.joints={lever: {friction: 200.0}}", Outcome.JAMMED),  # a lever that is stuck
        ("task.events.bolt.position=0.78", Outcome.JAMMED),  # a latch that the lever does not draw in time
        ("world.layout.door.x=1.2", Outcome.NO_IK),
    ],
)
def test_what_cannot_be_done_has_its_type(override: str, outcome: Outcome) -> None:
    require_engine("mujoco")
    wide = "world.objects.table.source.box=[3.0,1.4,0.4]"
    with make(WORLDS / f"{WORLD}.yaml", engine="mujoco", overrides=[override, wide, "task.horizon=3000"]) as env:
        env.reset(seed=4)
        policy, one = SkillPolicy(env), np.arange(1)
        policy.begin(one)
        for _ in range(3000):
            if policy.gave_up(one)[0]:
                break
            env.step(policy.act(one))
        assert OUTCOMES[policy.skill.outcome[0]] is outcome
        assert env.engine.get_state().joint_pos[0, env.engine.index.joint("door.leaf")] < 0.02
