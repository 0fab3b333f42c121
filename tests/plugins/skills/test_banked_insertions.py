"""Insertions from banks: the nearest of the good turns, the next where a peg jams, and counts of what came of it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

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
from anysim_banks.insertion import insertions
from tests.plugins.skills.banks import cube_bank, task, written
from tests.plugins.skills.test_pick import rollout

ENGINES = ["mujoco", pytest.param("pybullet", marks=pytest.mark.slow), pytest.param("sapien", marks=pytest.mark.slow)]
WRONG = 45.0


def block_bank(*degrees: float, margins: tuple[float, ...] = ()) -> Bank:
    """The peg of `peg_in_hole` turned by these angles in the hole of its block."""
    [method] = insertions(compile_world("peg_in_hole"), "block")
    grid = method.sampled(360, np.random.default_rng(0)).take(np.array(degrees, dtype=int))
    n = len(degrees)
    return Bank(
        method.subject.asset,
        "mouth",
        method.tool.name,
        method.subject.hash,
        method.tool.hash,
        grid.pose,
        grid.width,
        ("insertion",) * n,
        np.array(margins or (4.0,) * n),
        {e: np.ones(n, dtype=bool) for e in ("mujoco 3", "pybullet 3", "sapien 3")},
        {**method.about(), "link": method.subject.link},
    )


def env_of(path: Path, engine: str = "mujoco", num_envs: int = 2) -> TaskEnv:
    require_engine(engine)
    return make(path, engine=engine, num_envs=num_envs, overrides=["record.cameras=[]"])


def told(policy: SkillPolicy, env: int = 0) -> dict[str, Any]:
    found = policy.describe(env)["insertions"]
    assert isinstance(found, dict)
    return found


def turn_of(env: TaskEnv) -> np.ndarray:
    """(N,) [degrees] of the peg about the block's axis."""
    env.scene.look(None)
    peg, block = (env.scene.frame(name).quaternion for name in ("peg", "block"))
    seen = P.multiply(P.conjugate(block), peg)
    return np.degrees(2 * np.arctan2(seen[:, 2], seen[:, 3])) % 360


@pytest.mark.parametrize("engine", ENGINES)
def test_the_peg_goes_in_with_the_turn_of_the_bank(tmp_path: Path, engine: str) -> None:
    """It is within 0.6 rad of 0 when it is grasped, which is no turn of this bank."""
    bank = block_bank(90)
    written(tmp_path, bank)
    with env_of(task(tmp_path, "peg_in_hole", insertions="bank.json"), engine) as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        assert rollout(env, policy, 880) == ["success"] * 2
        np.testing.assert_allclose(turn_of(env), 90.0, atol=12.0)  # the play of 3 mm in 30 mm
        assert told(policy) == {"version": bank.version, "candidate": 0}


def test_of_turns_that_are_alike_the_nearest_is_taken(tmp_path: Path) -> None:
    written(tmp_path, block_bank(180, 0, 270, margins=(4.0, 3.5, 4.0)))
    with env_of(task(tmp_path, "peg_in_hole", insertions="bank.json")) as env:
        env.reset(seed=3)
        policy = SkillPolicy(env)
        assert rollout(env, policy, 880) == ["success"] * 2
        assert [told(policy, i)["candidate"] for i in range(2)] == [1, 1]


def test_a_turn_in_which_the_peg_jams_is_given_up_and_the_next_run_knows(tmp_path: Path) -> None:
    """It is trusted more than the right one, and less after its failure and the other's success."""
    bank = block_bank(WRONG, 0, margins=(6.0, 4.0))
    written(tmp_path, bank)
    path = task(tmp_path, "peg_in_hole", insertions="bank.json", living="counts")
    attempts: list[object] = []
    for _ in range(2):
        with env_of(path, num_envs=1) as env:
            env.reset(seed=3)
            policy = SkillPolicy(env)
            assert rollout(env, policy, 880) == ["success"]
            assert told(policy)["candidate"] == 1
            attempts.append(policy.skill.members[1].attempts[0])  # pyright: ignore[reportAttributeAccessIssue]
    assert attempts == [2, 1]
    belief = LivingBank(bank, "mujoco", tmp_path / "counts").belief
    assert belief.tolist() == [pytest.approx(1 / 3), pytest.approx(3 / 4)]


@pytest.mark.parametrize(
    ("expert", "words"),
    [
        ({"insertions": "hole.json"}, r"peg_in_hole\.yaml:4:\d+: task\.expert\.insertions: .*no bank of 'block' as it"),
        ({"insertions": "peg.json"}, r"peg_in_hole\.yaml:4:\d+: task\.expert\.insertions: .*else than 'peg\.tip'"),
        ({"insertions": "tip.json"}, r"task\.expert\.insertions: .*something else than 'peg\.tip'"),
        ({"insertions": "grasps.json"}, r"task\.expert\.insertions: .*no bank of 'block'"),
        ({"insertions": "sapien.json"}, r"task\.expert\.insertions: .*not tried on 'mujoco'"),
        (
            {"insertions": "bank.json", "living": "counts", "pinned_insertions": "abc"},
            r"peg_in_hole\.yaml:6:\d+: task\.expert\.pinned_insertions: the counts",
        ),
    ],
)
def test_what_does_not_fit_is_refused_at_its_key(tmp_path: Path, expert: dict[str, str], words: str) -> None:
    bank = block_bank(0)
    written(tmp_path, bank)
    written(tmp_path, replace(bank, asset_hash="of another"), "hole.json")
    written(tmp_path, replace(bank, gripper_hash="of another"), "peg.json")
    other = {**bank.provenance, "tip": [0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0]}
    written(tmp_path, replace(bank, provenance=other), "tip.json")
    written(tmp_path, cube_bank(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])), "grasps.json")
    written(tmp_path, replace(bank, passed={"sapien 3": np.array([True])}), "sapien.json")
    with env_of(task(tmp_path, "peg_in_hole", **expert)) as env, pytest.raises(SpecError, match=words):
        SkillPolicy(env)


def test_envs_do_not_disturb_each_other(tmp_path: Path) -> None:
    written(tmp_path, block_bank(WRONG, 0, 90))
    path, finals = task(tmp_path, "peg_in_hole", insertions="bank.json"), []
    for n in (1, 3):
        with env_of(path, num_envs=n) as env:
            env.reset(seed=2)
            rollout(env, SkillPolicy(env), 200)
            finals.append(env.engine.get_state().joint_pos[0].copy())
    assert (finals[0] == finals[1]).all()
