"""Grasps with several fingers from banks: dex_grasp takes them, gives up what fails, and refuses other hands' banks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim import make
from anysim.api import compile_world
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim.skills.bank import Bank
from anysim.skills.living_bank import LivingBank
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_banks.hand import hand
from anysim_banks.hand_grasps import HandGrasps
from anysim_banks.subject import subjects
from anysim_skills.grasping.dex_grasp import DexGrasp, around
from tests.plugins.skills.banks import task, written
from tests.plugins.skills.test_pick import rollout

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
PLACE = np.array([0.0, -0.014, -0.0135])
"""As the task has it: where the bottle's axis is in the hand."""


def bottle_bank(place: np.ndarray = PLACE, kind: str = "power", margin: float = 4.0) -> Bank:
    """Around the bottle of `dex_grasp`, 4 cm over its middle, from all sides."""
    method = HandGrasps(subjects(compile_world("dex_grasp"), "bottle")[0], hand("xarm7_allegro"))
    pose = around(np.array([[0.0, 0.0, 0.04]]), np.array([[0.0, 0.0, 1.0]]), place)[0]
    n = len(pose)
    passed = {e: np.ones(n, dtype=bool) for e in ("mujoco 3", "pybullet 3", "sapien 3")}
    return Bank(
        "bottle",
        "body",
        method.tool.name,
        method.subject.hash,
        method.tool.hash,
        pose,
        np.full(n, 0.06),
        (kind,) * n,
        np.full(n, margin),
        passed,
        {**method.about(), "link": 0},
    )


def both(first: Bank, second: Bank) -> Bank:
    n = len(second)
    return replace(
        first,
        pose=np.concatenate([first.pose, second.pose]),
        width=np.concatenate([first.width, second.width]),
        kind=first.kind + second.kind,
        margin=np.concatenate([first.margin, second.margin]),
        passed={e: np.ones(len(first) + n, dtype=bool) for e in first.passed},
    )


def env_of(path: Path, engine: str = "mujoco", num_envs: int = 2) -> TaskEnv:
    require_engine(engine)
    return make(path, engine=engine, num_envs=num_envs, overrides=["record.cameras=[]"])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_bottle_is_lifted_with_a_grasp_of_the_bank(tmp_path: Path, engine: str) -> None:
    bank = bottle_bank()
    written(tmp_path, bank)
    with env_of(task(tmp_path, "dex_grasp", bank="bank.json"), engine) as env:
        env.reset(seed=11)
        policy = SkillPolicy(env)
        assert rollout(env, policy, 780) == ["success"] * 2
        for i in range(2):
            told = policy.describe(i)["bank"]
            assert isinstance(told, dict)
            assert (told["version"], told["candidate"] >= 0) == (bank.version, True)


def test_a_grasp_beside_the_bottle_is_given_up_for_another_and_counted(tmp_path: Path) -> None:
    """Trusted most are those whose palm stays 9 cm from the bottle."""
    far = PLACE + np.array([0.0, 0.0, 0.09])
    bank = both(bottle_bank(far, margin=9.0).take([0, 4, 8, 12]), bottle_bank())
    written(tmp_path, bank)
    with env_of(task(tmp_path, "dex_grasp", bank="bank.json", living="counts"), num_envs=1) as env:
        env.reset(seed=11)
        policy = SkillPolicy(env)
        rollout(env, policy, 780)
        assert policy.describe(0)["ladder"], "the first has failed"
    belief = LivingBank(bank, "mujoco", tmp_path / "counts").belief
    assert (belief[:4] < 0.5).any()
    assert (belief[:4] <= 0.5).all()


def test_each_grasp_closes_by_its_own_synergy(tmp_path: Path) -> None:
    written(tmp_path, bottle_bank(kind="pinch"))
    with env_of(task(tmp_path, "dex_grasp", bank="bank.json"), num_envs=1) as env:
        env.reset(seed=11)
        policy, one = SkillPolicy(env), np.array([0])
        assert isinstance(policy.skill, DexGrasp)
        policy.begin(one)
        env.step(policy.act(one))
        hand_of = policy.skill.hand
        while not hand_of.closing[0]:
            env.step(policy.act(one))
        assert hand_of.synergies[hand_of.synergy[0]] == "pinch"


@pytest.mark.parametrize(
    ("bank", "words"),
    [
        ("thing.json", r"dex_grasp\.yaml:4:\d+: task\.expert\.bank: .*no bank of 'bottle' as it is here"),
        ("hand.json", r"dex_grasp\.yaml:4:\d+: task\.expert\.bank: .*another hand \(allegro_right\).*--gripper xarm7"),
        ("open.json", r"task\.expert\.bank: .*another hand"),
        ("sapien.json", r"task\.expert\.bank: .*not tried on 'mujoco'"),
    ],
)
def test_what_does_not_fit_is_refused_at_its_key(tmp_path: Path, bank: str, words: str) -> None:
    one = bottle_bank()
    written(tmp_path, replace(one, asset_hash="of another"), "thing.json")
    written(tmp_path, replace(one, gripper="allegro_right"), "hand.json")
    made = dict(one.provenance["hand"]) | {"opened": [0.1] * 16}  # pyright: ignore[reportArgumentType,reportCallIssue]
    written(tmp_path, replace(one, provenance={**one.provenance, "hand": made}), "open.json")
    written(tmp_path, replace(one, passed={"sapien 3": np.ones(len(one), dtype=bool)}), "sapien.json")
    with env_of(task(tmp_path, "dex_grasp", bank=bank)) as env, pytest.raises(SpecError, match=words):
        SkillPolicy(env)


def test_the_hand_is_turned_as_the_bank_says(tmp_path: Path) -> None:
    bank = bottle_bank()
    written(tmp_path, bank)
    with env_of(task(tmp_path, "dex_grasp", bank="bank.json")) as env:
        env.reset(seed=11)
        policy, every = SkillPolicy(env), np.arange(2)
        policy.begin(every)
        assert isinstance(policy.skill, DexGrasp)
        while (policy.skill.phase < 5).any():
            env.step(policy.act(every))
            if (policy.skill.phase == 5).all():
                break
        env.scene.look(None)
        seen = P.compose(P.inverse(env.scene.frame("bottle").pose), policy.skill.arm.tool.pose)
        for i in range(2):
            told = policy.describe(i)["bank"]
            assert isinstance(told, dict)
            assert P.norm(seen[i, :3] - bank.pose[told["candidate"], :3]) < 0.02
