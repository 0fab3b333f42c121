"""Grasps from banks: the best that can be reached is taken, others are refused with the key's line, outcomes count."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim import make, registry
from anysim.api import compile_world, dry_run, load
from anysim.errors import SpecError
from anysim.plugin_parameters import parameters
from anysim.skills.bank import read_bank
from anysim.skills.living_bank import LivingBank
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_recording.collector import Collector
from anysim_skills.grasping import banked
from tests.plugins.skills.banks import DOWN, badly_chosen, cube_bank, shifted, task, tilted, written
from tests.plugins.skills.test_manipulation import WORLDS
from tests.plugins.skills.test_pick import rollout

UP = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
BESIDE = shifted(DOWN, 0.0, 0.0, 0.06)
"""Fingers close over the cube."""


def env_of(path: Path, num_envs: int = 2, **more: Any) -> TaskEnv:
    require_engine("mujoco")
    return make(path, engine="mujoco", num_envs=num_envs, overrides=["record.cameras=[]"], **more)


def facts(policy: SkillPolicy, env: int = 0) -> dict[str, Any]:
    found = policy.describe(env)["bank"]
    assert isinstance(found, dict)
    return found


def test_the_best_grasp_that_can_be_reached_is_taken(tmp_path: Path) -> None:
    """One from below would go through the table, and one far away has no inverse kinematics: the third is taken."""
    bank = cube_bank(UP, shifted(DOWN, 0.0, 0.0, 3.0), tilted(DOWN, 0.3), DOWN)
    written(tmp_path, bank)
    with env_of(task(tmp_path, bank="bank.json")) as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        assert rollout(env, policy, 400) == ["success"] * 2
        assert facts(policy) == {"version": bank.version, "candidate": 2}


def test_a_grasp_that_fails_is_given_up_for_the_next_one(tmp_path: Path) -> None:
    written(tmp_path, cube_bank(BESIDE, DOWN))
    with env_of(task(tmp_path, bank="bank.json"), 1) as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        assert rollout(env, policy, 600) == ["success"]
        assert facts(policy)["candidate"] == 1
        assert policy.describe(0)["attempt"] == 2


@pytest.mark.parametrize(
    ("expert", "words"),
    [
        ({"bank": "other.json"}, r"pick_cube\.yaml:4:\d+: task\.expert\.bank: .*no bank of 'cube' as it is here"),
        (
            {"bank": "narrow.json"},
            r"pick_cube\.yaml:4:\d+: task\.expert\.bank: .*another gripper \(hand, which opens 0\.04 m",
        ),
        ({"bank": "none.json"}, r"pick_cube\.yaml:4:\d+: task\.expert\.bank: there is no bank at"),
        ({"bank": "empty"}, r"task\.expert\.bank: there are no banks in the folder"),
        ({"bank": "../bank.json"}, r"pick_cube\.yaml:4:\d+: task\.expert\.bank: '\.\./bank\.json' leaves"),
        ({"bank": "sapien.json"}, r"task\.expert\.bank: .*not tried on 'mujoco'"),
        ({"bank": "bank.json", "pinned": "abc"}, r"pick_cube\.yaml:5:\d+: task\.expert\.pinned: .*say where they are"),
        (
            {"bank": "bank.json", "living": "counts", "pinned": "abc"},
            r"pick_cube\.yaml:6:\d+: task\.expert\.pinned: the counts",
        ),
    ],
)
def test_what_does_not_fit_is_refused_at_its_key(tmp_path: Path, expert: dict[str, str], words: str) -> None:
    bank = cube_bank(DOWN)
    written(tmp_path, bank)
    written(tmp_path, replace(bank, asset_hash="of another"), "other.json")
    written(tmp_path, cube_bank(DOWN, stroke=0.04), "narrow.json")
    written(tmp_path, replace(bank, passed={"sapien 3": np.array([True])}), "sapien.json")
    (tmp_path / "empty").mkdir()
    with env_of(task(tmp_path, **expert)) as env, pytest.raises(SpecError, match=words):
        SkillPolicy(env)


def test_a_check_without_the_engine_looks_at_what_was_tried_on_it() -> None:
    """A bank holds for the engine that the file names, though names are looked up on the kinematic one."""
    for engine in ("mujoco", "sapien"):
        loaded = load("place_mug", overrides=[f"engine={engine}"])
        dry_run(loaded, compile_world(loaded))
    loaded = load("place_mug", overrides=["engine='null'"])
    with pytest.raises(SpecError, match=r"task\.expert\.bank: .* was not tried on 'null'"):
        dry_run(loaded, compile_world(loaded))


@pytest.mark.parametrize(
    ("of", "key"),
    [
        ("pick_cube", "bank"),
        ("place_on_pad", "bank"),
        ("lift_cube", "bank"),
        ("open_drawer", "bank"),
        ("dex_grasp", "bank"),
        ("peg_in_hole", "bank` or `insertions"),
    ],
)
def test_counts_without_a_bank_are_refused(tmp_path: Path, of: str, key: str) -> None:
    """Each skill that has both parameters: the counts would be of nothing, and would be left out silently."""
    words = rf"{of}\.yaml:4:\d+: task\.expert\.living: .* there is no `{key}`; make one with `anysim bank build`"
    with env_of(task(tmp_path, of, living="counts")) as env, pytest.raises(SpecError, match=words):
        SkillPolicy(env)
    words = rf"{of}\.yaml:4:\d+: task\.expert\.pinned: .* there is no `bank`"
    with env_of(task(tmp_path, of, pinned="abc")) as env, pytest.raises(SpecError, match=words):
        SkillPolicy(env)


def test_each_skill_that_counts_is_tried_without_a_bank() -> None:
    """`grasp`, `insert` and `take_hold` are what the others are made of, or share their constructor with one."""
    counting = {name for name in registry.names("skills") if "living" in parameters(registry.load("skills", name))}
    tried = {"pick", "pick_place", "lift", "open", "dex_grasp", "pick_insert"}
    assert counting == tried | {"grasp", "insert", "take_hold"}


def test_a_folder_has_what_fits_among_others(tmp_path: Path) -> None:
    (tmp_path / "banks").mkdir()
    bank = cube_bank(DOWN)
    written(tmp_path / "banks", bank)
    written(tmp_path / "banks", replace(bank, asset_hash="of another"), "a.json")
    with env_of(task(tmp_path, bank="banks")) as env:
        assert facts(SkillPolicy(env))["version"] == bank.version


def episodes(path: Path, count: int, seed: int = 5) -> tuple[int, str]:
    """How many of so many episodes of one env succeed, and the version of the counts that they went by."""
    with env_of(path, 1) as env:
        env.streams.seed(seed, np.arange(1))
        policy, won = SkillPolicy(env), 0
        for _ in range(count):
            env.reset()
            won += rollout(env, policy, 190) == ["success"]
        return won, facts(policy).get("counts", "")


def test_outcomes_are_counted_and_believed_by_the_next_run(tmp_path: Path) -> None:
    bank = cube_bank(BESIDE, DOWN)
    written(tmp_path, bank)
    path = task(tmp_path, bank="bank.json", living="counts")
    before, first = episodes(path, 3)
    counts = LivingBank(bank, "mujoco", tmp_path / "counts")
    assert counts.belief[0] < 0.5, "it has failed"
    after, second = episodes(path, 3)
    assert (second, first) == (counts.version, LivingBank(bank, "mujoco", tmp_path / "none").version)
    assert after == 3 > before

    kept = LivingBank(bank, "mujoco", tmp_path / "counts")
    pinned = task(tmp_path, bank="bank.json", living="counts", pinned=kept.version)
    assert episodes(pinned, 1)[1] == kept.version
    assert LivingBank(bank, "mujoco", tmp_path / "counts").version == kept.version, "none were added"


def test_the_badly_chosen_bank_is_what_is_written_beside_its_world() -> None:
    path = WORLDS / "bad_grasps.json"
    assert read_bank(path).document() == badly_chosen().document(), "python -m tests.plugins.skills.banks writes it"


@pytest.mark.slow
def test_outcomes_raise_the_yield_of_a_badly_chosen_bank(tmp_path: Path) -> None:
    """Three tries an episode, at what the run began with: two runs find out about six grasps, and the third holds."""

    def run(number: int, *more: str) -> int:
        require_engine("mujoco")
        with make(WORLDS / "bad_grasps.yaml", engine="mujoco", num_envs=4, overrides=more) as env:
            return sum(one.success for one in Collector(env, SkillPolicy(env), tmp_path / str(number), 8, number).run())

    living = f"task.expert.living={tmp_path / 'counts'}"
    first, second, third = (run(number, living) for number in range(3))
    assert (first, second) == (0, 0)
    assert third >= 6
    assert run(3) == 0


def test_envs_do_not_disturb_each_other(tmp_path: Path) -> None:
    written(tmp_path, cube_bank(tilted(DOWN, 0.3), BESIDE, DOWN))
    path, finals = task(tmp_path, bank="bank.json"), []
    for n in (1, 3):
        with env_of(path, n) as env:
            env.reset(seed=2)
            rollout(env, SkillPolicy(env), 120)
            finals.append(env.engine.get_state().joint_pos[0].copy())
    assert (finals[0] == finals[1]).all()


@pytest.mark.slow
def test_what_the_own_hand_has_no_room_for_comes_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """Grasps of a mug's rim that are as deep as the bank's gripper are held up by the hand of a Panda."""
    slipped: list[bool] = []
    for less in (banked.WITHOUT_ROOM, 0.0):
        monkeypatch.setattr(banked, "WITHOUT_ROOM", less)
        require_engine("pybullet")
        with make("place_mug", engine="pybullet", num_envs=8, overrides=["record.cameras=[]"]) as env:
            env.reset(seed=4001)
            policy = SkillPolicy(env)
            rollout(env, policy, 400)
            slipped.append(any("ladder" in policy.describe(i) for i in range(8)))
    assert slipped == [False, True]
