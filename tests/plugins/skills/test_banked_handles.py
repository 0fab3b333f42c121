"""Grasps of handles from banks: the best with which the arm goes the whole way, others are given up, outcomes count."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim import make
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.living_bank import LivingBank
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_skills.articulated.bar_grasps import TURNS
from anysim_skills.articulated.take_hold import TakeHold
from tests.plugins.skills.banks import handle_bank, shifted, task, written
from tests.plugins.skills.test_pick import rollout

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
GOOD = [np.concatenate([np.zeros(3), turn]) for turn in TURNS]
"""In the handle's frame, whose x points away from the front, and whose z is along the bar."""
BESIDE = shifted(GOOD[0], 0.045, 0.0, 0.0)
"""The fingers close before the bar."""
THROUGH = shifted(GOOD[0], -0.035, 0.0, 0.0)
"""The finger tips are inside of the front."""


def env_of(source: str | Path, engine: str = "mujoco", num_envs: int = 2, *overrides: str) -> TaskEnv:
    require_engine(engine)
    return make(source, engine=engine, num_envs=num_envs, overrides=["record.cameras=[]", *overrides])


def told(policy: SkillPolicy, env: int = 0) -> dict[str, Any]:
    found = policy.describe(env)["bank"]
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize("engine", ENGINES)
def test_a_drawer_is_opened_with_a_grasp_of_its_bank(tmp_path: Path, engine: str) -> None:
    """The best one would put the fingers into the front: the hand has no room there, and others come first."""
    bank = handle_bank(THROUGH, *GOOD)
    written(tmp_path, bank)
    with env_of(task(tmp_path, "open_drawer", bank="bank.json"), engine) as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        assert rollout(env, policy, 600) == ["success"] * 2
        assert told(policy)["version"] == bank.version
        for i in range(2):
            assert told(policy, i)["candidate"] > 0
            assert policy.describe(i)["attempt"] == 1


def test_a_grasp_beside_the_bar_is_given_up_and_the_next_run_knows(tmp_path: Path) -> None:
    bank = handle_bank(BESIDE, *GOOD)
    written(tmp_path, bank)
    path = task(tmp_path, "open_drawer", bank="bank.json", living="counts")
    taken: list[int] = []
    for attempts in (2, 1):
        with env_of(path, num_envs=1) as env:
            env.reset(seed=1)
            policy = SkillPolicy(env)
            assert rollout(env, policy, 690) == ["success"]
            taken.append(told(policy)["candidate"])
            assert policy.describe(0)["attempt"] == attempts
    assert taken[0] == taken[1] > 0
    belief = LivingBank(bank, "mujoco", tmp_path / "counts").belief
    assert belief[0] == pytest.approx(1 / 3), "it has failed once"
    assert belief[taken[0]] == pytest.approx(3 / 4), "it has succeeded twice"


@pytest.mark.parametrize("engine", ENGINES)
def test_the_hand_takes_hold_of_a_handle_where_the_bank_says(tmp_path: Path, engine: str) -> None:
    """Four centimetres along the bar from its middle: as one hand or the other."""
    aside = [shifted(pose, 0.0, 0.0, z) for pose in GOOD for z in (0.04, -0.04)]
    path = written(tmp_path, handle_bank(*aside))
    expert = f"task.expert={{skill: take_hold, robot: panda, part: cabinet.drawer_1, bank: {path}}}"
    with env_of("open_drawer", engine, 2, "task.expert=null", expert) as env:
        env.reset(seed=1)
        policy, both = SkillPolicy(env), np.arange(2)
        assert isinstance(policy.skill, TakeHold)
        policy.begin(both)
        for _ in range(250):
            env.step(policy.act(both))
        assert [OUTCOMES[code] for code in policy.skill.outcome] == [Outcome.OK] * 2
        env.scene.look(None)
        tool, handle = env.scene.frame("panda.tool").pose, env.scene.frame("cabinet.drawer_1.handle").pose
        found = P.compose(P.inverse(handle), tool)[:, :3]
        wanted = [0.04 if told(policy, i)["candidate"] % 2 == 0 else -0.04 for i in range(2)]
        np.testing.assert_allclose(found[:, 2], wanted, atol=0.006)
        np.testing.assert_allclose(found[:, :2], 0.0, atol=0.008)


@pytest.mark.parametrize(
    ("bank", "words"),
    [
        ("other.json", r"open_drawer\.yaml:4:\d+: task\.expert\.bank: .*no bank of 'cabinet\.drawer_1' as it is here"),
        ("door.json", r"open_drawer\.yaml:4:\d+: task\.expert\.bank: .*the link that is held must be the same.*door_1"),
        ("sapien.json", r"task\.expert\.bank: .*not tried on 'mujoco'"),
    ],
)
def test_what_is_of_another_part_is_refused_at_its_key(tmp_path: Path, bank: str, words: str) -> None:
    one = handle_bank(GOOD[0])
    written(tmp_path, replace(one, asset_hash="of another"), "other.json")
    written(tmp_path, handle_bank(GOOD[0], part="door_1"), "door.json")
    written(tmp_path, replace(one, passed={"sapien 3": np.array([True])}), "sapien.json")
    with env_of(task(tmp_path, "open_drawer", bank=bank)) as env, pytest.raises(SpecError, match=words):
        SkillPolicy(env)


def test_counts_are_pinned(tmp_path: Path) -> None:
    written(tmp_path, handle_bank(*GOOD))
    path = task(tmp_path, "open_drawer", bank="bank.json", living="counts", pinned="abc")
    with env_of(path) as env, pytest.raises(SpecError, match=r"open_drawer\.yaml:6:\d+: task\.expert\.pinned: the cou"):
        SkillPolicy(env)


def test_a_skill_that_closes_on_nothing_has_no_bank(tmp_path: Path) -> None:
    """`close` pushes with the open hand."""
    with pytest.raises(SpecError, match=r"task\.expert\.bank: unknown key"):
        env_of(task(tmp_path, "close_drawer", bank="bank.json")).close()


def test_envs_do_not_disturb_each_other(tmp_path: Path) -> None:
    written(tmp_path, handle_bank(BESIDE, *GOOD))
    path, finals = task(tmp_path, "open_drawer", bank="bank.json"), []
    for n in (1, 3):
        with env_of(path, num_envs=n) as env:
            env.reset(seed=2)
            rollout(env, SkillPolicy(env), 120)
            finals.append(env.engine.get_state().joint_pos[0].copy())
    assert (finals[0] == finals[1]).all()
