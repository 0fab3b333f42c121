"""Episodes of several commands: in order, in one world, with time limits and commands that may fail."""

from pathlib import Path

import numpy as np
import pytest

from anysim import api, make
from anysim.api import load
from anysim.errors import SpecError
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv

WORLDS = Path(__file__).parents[1] / "plugins/skills/worlds"
FILE = WORLDS / "open_and_close.yaml"


def followed(env: TaskEnv, policy: SkillPolicy, steps: int) -> list[list[str]]:
    """What each env said it was doing, each phase once."""
    ids = np.arange(env.num_envs)
    env.reset(seed=4)
    policy.begin(ids)
    said: list[list[str]] = [[] for _ in ids]
    for _ in range(steps):
        if (policy.skill.outcome != 0).all():
            break
        env.step(policy.act(ids))
        for i in ids:
            phase = str(policy.describe(int(i))["phase"])
            if said[i][-1:] != [phase]:
                said[i].append(phase)
    return said


def test_commands_follow_each_other_in_one_world() -> None:
    with make(FILE, engine="mujoco", num_envs=2) as env:
        policy = SkillPolicy(env)
        said = followed(env, policy, 900)
        assert [OUTCOMES[o] for o in policy.skill.outcome] == [Outcome.OK] * 2
        for phases in said:
            names = [phase.partition(":")[0] for phase in phases]
            assert list(dict.fromkeys(names)) == ["1 open", "2 close"]
        joint = [j.name for j in env.engine.world.joints].index("cabinet.drawer_1")
        assert (env.engine.get_state().joint_pos[:, joint] < 0.02).all()


@pytest.mark.parametrize(("required", "outcome"), [("true", Outcome.TIMEOUT), ("false", Outcome.OK)])
def test_a_command_that_takes_too_long_ends_the_episode_unless_it_is_optional(required: str, outcome: Outcome) -> None:
    late = "collect.commands.0.timeout=0.4", f"collect.commands.0.required={required}"
    with make(FILE, engine="mujoco", num_envs=1, overrides=late) as env:
        policy = SkillPolicy(env)
        followed(env, policy, 600)
        assert OUTCOMES[policy.skill.outcome[0]] is outcome
        ladder = policy.describe(0).get("ladder", [])
        assert ("timeout -> without 1 open" in ladder) == (outcome is Outcome.OK)  # type: ignore[operator]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            "collect.commands.1.do=clsoe",
            "collect.commands.1.do: no skill named 'clsoe' is installed; did you mean 'close'",
        ),
        ("collect.commands.1.part=cabinet.drawer_9", "collect.commands.1.part: 'cabinet' has no joint 'drawer_9'"),
        ("collect.commands.1.fractoin=0.1", "did you mean 'fraction'"),
        ("collect.commands=[]", "collect.commands: expected at least 1 item"),
    ],
)
def test_a_fault_in_a_command_is_told_with_its_place(change: str, words: str) -> None:
    with pytest.raises(SpecError) as fault:
        checked(change)
    assert words in str(fault.value)


def checked(change: str) -> None:
    loaded = load(FILE, overrides=[change])
    api.dry_run(loaded, api.compile_world(loaded))
