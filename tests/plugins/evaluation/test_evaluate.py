"""`anysim evaluate`: the same episodes whatever the envs, logs that go on, and what is said of the outcomes."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

import anysim
from anysim.errors import AnysimError, RecordError, SpecError, TaskError
from anysim.skills.phases import MovingSkill
from anysim.testing.engines import require_drawing
from anysim_evaluation import policy as policies
from anysim_evaluation.cli import evaluate as cli
from anysim_evaluation.driver import Episode, drive, episode_seeds
from anysim_evaluation.expert import ExpertPolicy
from anysim_evaluation.log import EpisodeLog
from anysim_evaluation.page import page
from anysim_evaluation.policy import make_policy
from anysim_evaluation.summary import agreement, agreements, gap_interval, ground_table, summary

BLIND = ["record.cameras=[]"]
SEEDS = episode_seeds("validation", 0, 5)
app = typer.Typer()
app.command()(cli.evaluate)


def run(task: str, policy: Any, num_envs: int = 2, *overrides: str, **options: Any) -> list[Episode]:
    """The episodes of SEEDS, in their order."""
    with anysim.make(task, engine="mujoco", num_envs=num_envs, overrides=[*BLIND, *overrides]) as env:
        made = make_policy(env, policy) if isinstance(policy, str) else policy(env)
        return sorted(drive(env, made, SEEDS, **options), key=lambda e: e.seed)


class Chunked:
    """The action zero, three steps at a time; what it was shown is kept."""

    def __init__(self, env: Any, length: int = 3, columns: int = 0) -> None:
        self.shape = (length, env.action_dim + columns)
        self.asked: list[int] = []
        self.groups: set[str] = set()

    def reset(self, env_ids: Any) -> None:
        pass

    def act(self, obs: Any, env_ids: Any) -> Any:
        self.asked.append(len(env_ids))
        self.groups |= set(obs)
        return np.zeros((len(env_ids), *self.shape))


# ------------------------------------------------------------------ policies and the driver


@pytest.mark.parametrize("policy", ["expert:sigma=0.2", "random"])
def test_episodes_do_not_depend_on_the_number_of_envs(policy: str) -> None:
    few = run("reach", policy, 1, "task.horizon=60")
    assert few == run("reach", policy, 4, "task.horizon=60")
    assert [e.seed for e in few] == SEEDS
    assert len({e.total_reward for e in few}) == 5


def test_the_expert_solves_what_doing_nothing_does_not() -> None:
    assert {e.status for e in run("reach", "expert")} == {"success"}
    idle = run("reach", "zero", 2, "task.horizon=20")
    assert {(e.status, e.failure, e.steps) for e in idle} == {("truncated", "truncated", 20)}


def test_what_the_expert_gives_up_has_its_type() -> None:
    far = ["world.layout.cube.x=0.75", "world.layout.cube.y=0.6"]
    assert {e.failure for e in run("pick_cube", "expert", 5, *far)} == {"no_ik"}


def test_without_retries_the_first_failure_is_the_end() -> None:
    far = ["world.layout.cube.x=0.75", "world.layout.cube.y=0.6"]
    with anysim.make("stack_cube", engine="mujoco", overrides=[*BLIND, *far]) as env:
        climbed: dict[str, list[str]] = {}
        for name in ("expert", "expert:retries=off"):
            policy = make_policy(env, name)
            (one,) = drive(env, policy, SEEDS[:1])
            assert (one.status, one.failure) == ("failed", "no_ik")
            assert isinstance(policy, ExpertPolicy)
            assert isinstance(policy.skill, MovingSkill)
            climbed[name] = [rung for _, rung in policy.skill.history(0)]
    assert len(climbed["expert"]) > 1
    assert climbed["expert:retries=off"] == ["give up"]


def test_a_chunk_is_carried_out_before_the_policy_is_asked_again() -> None:
    made: list[Chunked] = []
    run("reach", lambda env: made.append(Chunked(env)) or made[0], 5, "task.horizon=9")
    assert made[0].asked == [5, 5, 5]
    assert made[0].groups == {"policy"}
    run("pick_cube", lambda env: made.append(Chunked(env)) or made[1], 5, "task.horizon=3", privileged=True)
    assert made[1].groups == {"policy", "privileged"}


def test_what_are_no_actions_is_refused() -> None:
    with pytest.raises(TaskError, match=r"gave \(2, 3, 9\); expected actions \(2, 8\) or chunks \(2, K, 8\)"):
        run("reach", lambda env: Chunked(env, columns=1))


def test_policies_by_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert policies.parse("expert:sigma=0.5") == ("expert", {"sigma": 0.5}, "")
    assert policies.parse("my.module:act") == ("my.module", {}, "act")
    assert policies.parse("runs/a.b=c/policy.onnx") == ("file", {"path": "runs/a.b=c/policy.onnx"}, "")
    assert policies.parse("expert:retries=off").options == {"retries": False}
    assert policies.parse("lerobot:runs/lr=1/act,steps=5") == ("lerobot", {"path": "runs/lr=1/act", "steps": 5.0}, "")
    assert policies.parse("lerobot:path=17").options == {"path": "17"}
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TaskError, match=r"'act' is no KEY=VALUE"):
        policies.parse("lerobot:act")
    (tmp_path / "act").mkdir()
    assert policies.parse("lerobot:act").options == {"path": "act"}
    for wrong in ("expert:=1", "expert:sigma=1,sigma=2", "a b:c d"):
        with pytest.raises(TaskError, match="--policy"):
            policies.parse(wrong)
    with anysim.make("reach", engine="mujoco", overrides=BLIND) as env:
        for name, said in (("nobody", "nobody"), ("expert:sigma=-1", "policy.sigma"), ("expert:gain=1", "policy.gain")):
            with pytest.raises((AnysimError, SpecError), match=said):
                make_policy(env, name)
        with pytest.raises(TaskError, match="a module on the Python path, and a function in it"):
            make_policy(env, "json:no_such_function")
        monkeypatch.setattr(json, "twos", lambda obs: np.full((len(obs["policy"]), 8), 2.0), raising=False)
        assert (make_policy(env, "json:twos").act(env.reset(seed=0)[0], np.array([0])) == 2.0).all()


def test_splits_are_apart_and_end() -> None:
    splits = [set(episode_seeds(name, 0, 200)) for name in ("train", "validation", "test")]
    assert len(set.union(*splits)) == 600
    for split, first, said in (("tset", 0, "expected one of train, validation, test"), ("test", 150, "has 200 seeds")):
        with pytest.raises(TaskError, match=said):
            episode_seeds(split, first, 100)


# ------------------------------------------------------------------ logs


def episode(seed: int, success: bool = True, failure: str = "no_ik") -> Episode:
    return Episode(seed, "success" if success else "failed", "" if success else failure, 10 + seed, 0.1 * seed)


def test_a_log_goes_on_where_it_was_cut_off(tmp_path: Path) -> None:
    with EpisodeLog(tmp_path, {"task": "a"}) as log:
        log.add(episode(1))
        log.add(episode(2, False))
        with pytest.raises(RecordError, match="another run"):
            EpisodeLog(tmp_path, {"task": "a"})
    path = tmp_path / "episodes.jsonl"
    path.write_bytes(path.read_bytes()[:-7])
    with EpisodeLog(tmp_path, {"task": "a"}) as log:
        assert log.episodes == {1: episode(1)}
        log.add(episode(3))
    with EpisodeLog(tmp_path, {"task": "a"}) as log:
        assert log.episodes == {1: episode(1), 3: episode(3)}
    with pytest.raises(RecordError, match="has episodes of something else: task 'a' and now 'b'"):
        EpisodeLog(tmp_path, {"task": "b"})
    path.write_text("[1]\n{}\n")
    with pytest.raises(RecordError, match="is no log of episodes"):
        EpisodeLog(tmp_path, {"task": "a"})


# ------------------------------------------------------------------ what is said


def test_faults_are_no_attempts() -> None:
    told = summary([episode(1), episode(2, False), episode(3, False, "lost"), Episode(4, "fault", "fault", 1, 0.0)])
    assert (told["attempts"], told["successes"], told["faults"]) == (3, 1, 1)
    assert told["failures"] == {"lost": 1, "no_ik": 1}
    assert told["success_rate"] == pytest.approx(1 / 3)
    assert told["interval"] == pytest.approx([0.0615, 0.7923], abs=1e-3)
    assert told["steps"] == 11


def test_successes_by_kind_and_level_of_the_ground() -> None:
    said = [("pits", 1, False), ("stairs down", 1, True), ("stairs down", 1, True), ("pits", 0, True)]
    tiles = [replace(episode(k, won), ground=kind, ground_level=level) for k, (kind, level, won) in enumerate(said)]
    told = summary([*tiles, Episode(9, "fault", "fault", 1, 0.0, ground="pits", ground_level=0)])["ground"]
    rows = {(one["kind"], one["level"]): (one["successes"], one["attempts"]) for one in told}
    assert rows == {
        ("pits", 0): (1, 1),
        ("pits", 1): (0, 1),
        ("pits", None): (1, 2),
        ("stairs down", 1): (2, 2),
        ("stairs down", None): (2, 2),
        (None, 0): (1, 1),
        (None, 1): (2, 3),
        (None, None): (3, 4),
    }
    assert told[-1]["interval"] == pytest.approx([0.3006, 0.9544], abs=1e-4)
    columns, cells = ground_table(told)
    assert columns == ["ground", "level 0", "level 1", "all levels"]
    assert [row[0] for row in cells] == ["pits", "stairs down", "all"]
    assert cells[1] == ["stairs down", "", "2/2 (34-100 %)", "2/2 (34-100 %)"]
    assert summary([episode(1)])["ground"] == []


def test_episodes_on_tiles_say_where_they_were(tmp_path: Path) -> None:
    """Each draws its tile; the same seed the same tile, and the log keeps it."""
    ground = (
        "{kind: tiles, cell: 0.2, tiles: {rows: 2, size: 4.0, columns: [{kind: stairs, down: true}, {kind: pits}]}}"
    )
    words = ["reach", "-e", "mujoco", "-p", "zero", "-k", "8", "--out", str(tmp_path), "-o", "task.horizon=2"]
    done = CliRunner().invoke(app, [*words, "-o", f"world.terrain={ground}"])
    assert done.exit_code == 0, done.exception
    assert "level 0" in done.output
    told = json.loads((tmp_path / "evaluation.json").read_text())["engines"]["mujoco"]
    seen = {(one["ground"], one["ground_level"]) for one in told["episodes"]}
    assert seen <= {(kind, level) for kind in ("stairs down", "pits") for level in (0, 1)}
    assert len(seen) > 1
    assert told["ground"][-1]["attempts"] == 8
    assert "Success by ground, mujoco" in (tmp_path / "evaluation.html").read_text()


def test_agreement_is_cohens_and_mcnemars() -> None:
    # 20 both, 15 neither, 5 and 10 alone: kappa (0.7 - 0.5) / 0.5 of Cohen's own example
    outcomes = [(True, True)] * 20 + [(True, False)] * 5 + [(False, True)] * 10 + [(False, False)] * 15
    a, b = ({k: episode(k, pair[side]) for k, pair in enumerate(outcomes)} for side in (0, 1))
    told = agreement(a, b)
    assert (told["seeds"], told["only_first"], told["only_second"]) == (50, 5, 10)
    assert told["agree"] == pytest.approx(0.7)
    assert told["kappa"] == pytest.approx(0.4)
    assert told["p"] == pytest.approx(0.3018, abs=1e-3)  # two-sided, 5 or fewer of 15 fair coins
    # 6/52 and 11/52: -5/52 -+ 1.96 sqrt((17/52 - (5/52)^2) / 52)
    assert (told["gap"], *told["gap_interval"]) == pytest.approx((-0.1, -0.2494, 0.0571), abs=1e-3)
    same = agreement(dict(list(a.items())[:3]), a)
    assert (same["agree"], same["kappa"], same["p"]) == (1.0, None, 1.0)
    assert agreement(a, {})["seeds"] == 0
    assert [(pair["first"], pair["second"]) for pair in agreements({"x": a, "y": b, "z": a})] == [
        ("x", "y"),
        ("x", "z"),
        ("y", "z"),
    ]


def test_the_interval_of_a_gap_covers_it() -> None:
    """Ten thousand pairs of rates on 40 shared seeds: 95 in 100 intervals hold the true difference."""
    drawn = np.random.default_rng(0).multinomial(40, [0.6, 0.2, 0.05, 0.15], size=10_000)
    held = [low <= 0.15 <= high for low, high in (gap_interval(int(b), int(c), 40) for _, b, c, _ in drawn)]
    assert np.mean(held) == pytest.approx(0.95, abs=0.015)
    assert gap_interval(0, 0, 0) == (-1.0, 1.0)


def test_what_successes_took() -> None:
    said = [("success", 3.0, 1, 2), ("success", 5.0, 0, 2), ("failed", 4.0, 3, 1)]
    told = summary(
        [Episode(k, s, "", 1, 0.0, sim_s, retries, done, 2) for k, (s, sim_s, retries, done) in enumerate(said)]
    )
    assert (told["sim_s_per_success"], told["retries_per_success"]) == (6.0, 2.0)
    assert told["commands_done"] == pytest.approx(5 / 6)
    silent = summary([Episode(1, "failed", "lost", 1, 0.0, 2.0)])
    assert [silent[key] for key in ("sim_s_per_success", "retries_per_success", "commands_done")] == [None] * 3


def test_the_expert_tells_its_retries_and_commands() -> None:
    far = ["world.layout.cube.x=0.75", "world.layout.cube.y=0.6"]
    assert {(e.retries, e.done, e.required) for e in run("pick_cube", "expert", 5, *far)} == {(2, None, None)}
    assert {e.retries for e in run("pick_cube", "expert:retries=off", 5, *far)} == {0}
    short = run("put_away", "expert", 5, "task.horizon=300")
    assert {(e.status, e.retries, e.done, e.required, e.sim_s) for e in short} == {("truncated", 0, 1, 3, 6.0)}
    assert {(e.retries, e.done) for e in run("reach", "zero", 5, "task.horizon=3")} == {(None, None)}


def test_from_the_command_line_and_again(tmp_path: Path) -> None:
    words = ["reach", "-e", "mujoco", "-k", "4", "-n", "2", "--out", str(tmp_path), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    one = told["engines"]["mujoco"]
    assert (one["attempts"], one["successes"], told["agreement"]) == (4, 4, [])
    assert [e["seed"] for e in one["episodes"]] == episode_seeds("validation", 0, 4)
    log = tmp_path / "mujoco/episodes.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    log.write_bytes(b"".join(lines[:3]))
    assert json.loads(CliRunner().invoke(app, words).output) == told
    assert log.read_bytes().splitlines(keepends=True)[:3] == lines[:3]
    text = (tmp_path / "evaluation.html").read_text("utf-8")
    assert text == page(told)
    assert ElementTree.fromstring(text.partition("\n")[2]) is not None
    other = CliRunner().invoke(app, [*words, "--policy", "zero"])
    assert "has episodes of something else: policy 'expert' and now 'zero'" in str(other.exception)


def test_first_successes_and_failures_are_filmed(tmp_path: Path) -> None:
    require_drawing("mujoco")
    words = ["reach", "-e", "mujoco", "-k", "5", "-p", "expert:sigma=0.5", "--out", str(tmp_path), "--json"]
    small = ["-o", "task.horizon=130", "-o", "world.cameras.front.size=[64, 48]"]
    told = json.loads(CliRunner().invoke(app, [*words, *small, "--videos", "1"]).output)
    by_seed = {e["seed"]: e for e in told["engines"]["mujoco"]["episodes"]}
    paths = told["videos"]["mujoco"]
    assert len(paths) == len({e["status"] for e in by_seed.values()}), "one of each kind that there is"
    for path in paths:
        kind, seed = Path(path).stem.split("-")
        episode = by_seed[int(seed)]
        assert (kind == "success") == (episode["status"] == "success")
        with Image.open(tmp_path / path) as video:
            assert video.size == (64, 48)
            assert video.n_frames == -(-episode["steps"] // 4), "12.5 images in a second of 50 control steps"
    assert all(f'src="{path}"' in (tmp_path / "evaluation.html").read_text() for path in paths)


def test_all_engines_and_levels(tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app, ["pick_cube", "-e", "mujoco", "-k", "2", "--level", "L0", "--out", str(tmp_path), "--json"]
    )
    assert done.exit_code == 0, done.output
    assert json.loads(done.output)["level"] == "L0"
    wrong = CliRunner().invoke(app, ["pick_cube", "-e", "mujoco", "--level", "L9", "--out", str(tmp_path / "b")])
    assert "there is no level 'L9'" in str(wrong.exception)


@pytest.mark.slow
def test_engines_agree_on_reach(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["reach", "-e", "all", "-k", "6", "--out", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert {"mujoco", "pybullet", "sapien"} <= set(told["engines"])
    assert all(pair["agree"] == 1.0 for pair in told["agreement"])


def test_the_default_folder_names_a_level_where_there_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["pick_cube", "-e", "mujoco", "-k", "1", "-p", "zero", "-o", "task.horizon=2"]
    for more in ([], ["--level", "L0"]):
        done = CliRunner().invoke(app, [*words, *more])
        assert done.exit_code == 0, done.output
    assert {path.name for path in (tmp_path / "runs").iterdir()} == {
        "evaluate-pick_cube-zero-validation",
        "evaluate-pick_cube-zero-L0-validation",
    }
