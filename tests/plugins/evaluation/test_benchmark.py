"""`anysim benchmark`: what is frozen, runs that go on, and figures that do not depend on how they were made."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from anysim.errors import RecordError, SpecError, TaskError
from anysim_evaluation.benchmark import freezing
from anysim_evaluation.benchmark.page import matrix, page
from anysim_evaluation.benchmark.protocol import load_protocol, shipped
from anysim_evaluation.benchmark.results import Cell, figures
from anysim_evaluation.cli import benchmark as cli
from anysim_evaluation.driver import Episode
from anysim_schemas.benchmark import BenchmarkSpec

TEXT = """name: tiny
tasks:
  reach: {horizon: 12}
  short: {task: reach, horizon: 6}
engines: {mujoco: {}, threads: {engine: mujoco, options: {threads: 1}}}
policies: {zero: zero, random: {policy: random, trained_on: mujoco}}
reference: {engine: mujoco, policy: random}
seeds: {split: validation, episodes: 4}
control_rate: 50
num_envs: 2
"""

GUIDE = Path(__file__).parents[3] / "docs" / "examples" / "benchmarks" / "arms.yaml"


def invoke(*words: object) -> Any:
    return CliRunner().invoke(cli.app, [str(word) for word in words])


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.yaml"
    path.write_text(TEXT)
    freezing.freeze(load_protocol(str(path)))
    return path


def lines(out: Path) -> dict[str, int]:
    return {str(p.relative_to(out)): len(p.read_bytes().splitlines()) for p in out.rglob("episodes.jsonl")}


# ------------------------------------------------------------------ what is frozen


def test_what_moved_is_named(tiny: Path) -> None:
    def moved(old: str = "", new: str = "") -> list[str]:
        tiny.write_text(TEXT.replace(old, new) if old else TEXT)
        loaded = load_protocol(str(tiny))
        return freezing.moved(loaded, freezing.parts(loaded))

    assert moved() == []
    assert "tasks.short.horizon was 6 steps and is 7 steps" in moved("horizon: 6", "horizon: 7")
    assert moved("zero: zero", "zero: random") == ["policies.zero was zero and is random"]
    assert moved("episodes: 4", "episodes: 5") == [
        "seeds was validation, 10000 to 10003 and is validation, 10000 to 10004"
    ]
    assert moved("zero: zero, ", "") == ["policies.zero is gone"]
    done = invoke("run", tiny, "--out", tiny.parent / "out")
    assert "is not what was frozen: policies.zero is gone" in str(done.exception)
    assert not (tiny.parent / "out").exists()


def test_what_is_not_as_asked_for_is_refused_with_its_place(tiny: Path) -> None:
    for old, new, said in (
        ("control_rate: 50", "control_rate: 20", "tiny.yaml:9:15: control_rate: the task 'reach' takes 50 actions"),
        ("threads: {engine: mujoco,", "threads: {engine: mujoco, version: '0.1',", "the protocol asks for 0.1"),
        ("zero: zero", "zero: zeroo", "tiny.yaml:6:18: policies.zero: no env_policy named 'zeroo'"),
        ("zero: zero", "zero: no.such:act", "there is no module 'no.such' on the Python path"),
        ("zero: zero", "zero: 'expert:sigma=-1'", "tiny.yaml:6:18: policies.zero: policies.zero.sigma"),
    ):
        tiny.write_text(TEXT.replace(old, new))
        with pytest.raises(SpecError) as found:
            freezing.parts(load_protocol(str(tiny)))
        assert said in str(found.value)


def test_the_file_of_a_policy_is_frozen(tiny: Path, tmp_path: Path) -> None:
    model = tmp_path / "policy.onnx"
    tiny.write_text(TEXT.replace("zero: zero", f"zero: {model}"))
    with pytest.raises(SpecError, match=r"tiny\.yaml:6:18: policies\.zero: .*policy\.onnx cannot be read"):
        freezing.parts(load_protocol(str(tiny)))
    said = set()
    for content in (b"one", b"other"):
        model.write_bytes(content)
        said.add(freezing.parts(load_protocol(str(tiny)))["policies.zero"])
    assert len(said) == 2


def test_the_policy_that_a_task_ships_is_frozen(tiny: Path) -> None:
    text = TEXT.replace("short: {task: reach", "short: {task: stand_still")
    tiny.write_text(text.replace("zero: zero", "zero: shipped"))
    named = freezing.parts(load_protocol(str(tiny)))
    assert len(named["tasks.short.shipped"]) == 64
    assert "tasks.reach.shipped" not in named
    tiny.write_text(text)
    assert named.keys() - freezing.parts(load_protocol(str(tiny))).keys() == {"tasks.short.shipped"}


def test_a_frozen_file_is_its_hash(tiny: Path) -> None:
    loaded = load_protocol(str(tiny))
    loaded.frozen.write_text(loaded.frozen.read_text().replace("12 steps", "13 steps"))
    with pytest.raises(RecordError, match="its hash is not that of its parts"):
        freezing.moved(loaded, freezing.parts(loaded))
    loaded.frozen.unlink()
    with pytest.raises(RecordError, match="is not frozen yet; run `anysim benchmark freeze"):
        freezing.moved(loaded, {})


def test_shipped_protocols_are_what_they_say(tmp_path: Path) -> None:
    protocol = load_protocol("core12")
    spec = protocol.spec
    assert freezing.moved(protocol, freezing.parts(protocol)) == [], "`anysim benchmark run core12` would refuse"
    assert (len(spec.tasks), len(spec.policies), len(spec.engines)) == (12, 7, 3)
    assert "core12" in shipped()
    told = json.loads((Path(__file__).parents[3] / "docs" / "benchmark.json").read_text())
    assert told["frozen"] == json.loads(protocol.frozen.read_text())["hash"]
    assert told["left"] == 0
    with pytest.raises(TaskError, match="there is no protocol 'core13'; shipped are"):
        load_protocol("core13")
    mine = tmp_path / "mine.yaml"
    mine.write_text("extends: benchmark:core12\nname: mine\nseeds: {episodes: 2}\n")
    changed = load_protocol(str(mine))
    assert (changed.spec.tasks, changed.seeds(), changed.path) == (spec.tasks, [20000, 20001], mine)
    listed = invoke("list", "--json")
    assert [one["name"] for one in json.loads(listed.output)] == list(shipped())


# ------------------------------------------------------------------ runs


def test_a_run_goes_on_and_comes_out_the_same(tiny: Path) -> None:
    out = tiny.parent / "out"
    part = invoke("run", tiny, "--out", out, "--only", "short/*/random", "--json")
    assert part.exit_code == 0, part.output
    assert json.loads(part.output)["left"] == 32 - 8
    assert lines(out) == {f"short/{engine}/random/episodes.jsonl": 5 for engine in ("mujoco", "threads")}
    done = invoke("run", tiny, "--out", out, "--json")
    told = json.loads(done.output)
    assert (told["left"], told["absent"], told["moved"]) == (0, [], [])
    assert set(lines(out).values()) == {5}
    assert len(lines(out)) == 8
    assert [one["outcomes"] for one in told["rows"]] == ["tttt"] * 8
    same = [pair for pair in told["engines"] if pair["policy"] is None]
    assert [(pair["seeds"], pair["agree"]) for pair in same] == [(16, 1.0)]

    spent = json.loads((out / "costs.json").read_text())
    assert [(one["episodes"], one["cpu_s"] > 0, one["cpu_s_per_success"]) for one in spent] == [(4, True, None)] * 8

    written = (out / "results.json").read_bytes(), (out / "results.html").read_bytes()
    assert ElementTree.fromstring(written[1].decode().partition("\n")[2]) is not None
    log = out / "reach/mujoco/zero/episodes.jsonl"
    log.write_bytes(log.read_bytes()[:-9])  # as a killed process leaves it
    assert "reach/mujoco/zero seed 10003" in invoke("run", tiny, "--out", out).output
    assert ((out / "results.json").read_bytes(), (out / "results.html").read_bytes()) == written
    assert page(told) == written[1].decode()


def test_episodes_of_another_protocol_are_not_mixed(tiny: Path) -> None:
    out = tiny.parent / "out"
    assert invoke("run", tiny, "--out", out, "--only", "short/mujoco/zero").exit_code == 0
    tiny.write_text(TEXT.replace("horizon: 12", "horizon: 13"))
    told = json.loads(invoke("run", tiny, "--out", out, "--moved", "--only", "short/mujoco/zero", "--json").output)
    assert "tasks.reach.horizon was 12 steps and is 13 steps" in told["moved"]
    assert "These are no results of the protocol" in (out / "results.html").read_text()
    tiny.write_text(TEXT.replace("horizon: 6", "horizon: 7"))
    done = invoke("run", tiny, "--out", out, "--moved")
    assert "has episodes of a protocol that was frozen otherwise" in str(done.exception)
    assert "the protocol has no engine 'bullet'" in str(invoke("run", tiny, "--moved", "--only", "*/bullet").exception)


def test_a_policy_more_needs_no_other_protocol(tiny: Path) -> None:
    out, frozen = tiny.parent / "out", json.loads(load_protocol(str(tiny)).frozen.read_text())["hash"]
    added = invoke(
        "run", tiny, "--out", out, "--policy", "mine=expert:sigma=0.1", "--only", "short/mujoco/mine", "--json"
    )
    assert added.exit_code == 0, added.exception
    told = json.loads(added.output)
    assert (told["added"], told["frozen"], told["moved"]) == (["mine"], frozen, [])
    assert [one["policy"] for one in told["rows"]] == ["mine"]
    for words in ("zero=zero", "mine"):
        assert "--policy" in str(invoke("run", tiny, "--policy", words).exception)


def test_what_an_engine_cannot_run_is_told(tiny: Path) -> None:
    tiny.write_text(
        TEXT.replace("short: {task: reach", "lift: {task: pick_cube").replace(
            "threads: {engine: mujoco, options: {threads: 1}}", "still: {engine: 'null'}"
        )
    )
    freezing.freeze(load_protocol(str(tiny)))
    done = invoke("run", tiny, "--out", tiny.parent / "out", "--only", "lift/still", "--json")
    assert done.exit_code == 0, done.exception
    told = json.loads(done.output)
    assert [(one["task"], one["engine"]) for one in told["absent"]] == [("lift", "still")] * 2
    assert "null cannot run 'pick_cube'" in told["absent"][0]["why"]
    assert told["left"] == 32 - 8


def test_the_protocol_of_the_guide_runs(tmp_path: Path) -> None:
    path = tmp_path / "arms.yaml"
    path.write_text(GUIDE.read_text())
    assert invoke("freeze", path).exit_code == 0
    assert "as frozen" in invoke("show", path).output
    done = invoke("run", path, "--out", tmp_path / "out", "--only", "short_reach/mujoco/random", "--json")
    assert done.exit_code == 0, done.exception
    assert json.loads(done.output)["left"] == 2 * 2 * 3 * 4 - 4


@pytest.mark.slow
def test_neither_workers_nor_kills_change_the_results(tiny: Path) -> None:
    text = TEXT.replace("horizon: 12", "horizon: 120").replace("horizon: 6", "horizon: 60")
    tiny.write_text(text.replace("episodes: 4", "episodes: 16"))
    freezing.freeze(load_protocol(str(tiny)))
    code = "import sys; from anysim.cli.main import main; sys.exit(main())"

    def command(out: Path, workers: int) -> list[str]:
        return [sys.executable, "-c", code, "benchmark", "run", str(tiny), "--out", str(out), "--workers", str(workers)]

    alone, killed = tiny.parent / "alone", tiny.parent / "killed"
    subprocess.run(command(alone, 1), check=True, capture_output=True, timeout=120)
    for done in (6, 48):
        run = subprocess.Popen(command(killed, 2), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 60
        while sum(lines(killed).values()) < done and run.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        os.kill(run.pid, signal.SIGKILL)
        assert run.wait() == -signal.SIGKILL
    subprocess.run(command(killed, 2), check=True, capture_output=True, timeout=120)
    assert (alone / "results.json").read_bytes() == (killed / "results.json").read_bytes()
    assert set(lines(killed).values()) == {17}
    assert list(killed.glob("*.worker")) == []


# ------------------------------------------------------------------ figures


def test_figures_against_an_example_by_hand() -> None:
    spec = BenchmarkSpec.model_validate(
        {
            "name": "hand",
            "tasks": {"a": {}, "b": {}},
            "engines": {"x": {}, "y": {}},
            "policies": {"good": {"policy": "good", "trained_on": "x"}, "bad": {"policy": "bad", "trained_on": "y"}},
            "reference": {"engine": "x", "policy": "good"},
        }
    )
    words = {"s": "success", "f": "failed", "t": "truncated", "x": "fault"}

    def episodes(said: str, steps: int) -> dict[int, Episode]:
        return {k: Episode(k, words[c], "" if c == "s" else words[c], steps, 0.0) for k, c in enumerate(said)}

    found = {
        Cell("a", "x", "good"): episodes("sssf", 10),
        Cell("a", "x", "bad"): episodes("sttt", 20),
        Cell("a", "y", "good"): episodes("ssxt", 15),
        Cell("a", "y", "bad"): episodes("ssss", 10),
        Cell("b", "x", "good"): episodes("ssss", 8),
        Cell("b", "x", "bad"): episodes("ffff", 8),
    }
    told = figures(spec, found)
    rows = {(one["task"], one["engine"], one["policy"]): one for one in told["rows"]}
    third = rows["a", "y", "good"]
    assert (third["attempts"], third["faults"], third["outcomes"], third["length"]) == (3, 1, "ssxt", 1.5)
    assert (third["success"], third["failure"], third["truncation"]) == pytest.approx((2 / 3, 0.0, 1 / 3))
    assert rows["b", "x", "bad"]["length"] is None
    means = {(one["engine"], one["policy"]): (one["tasks"], one["success"]) for one in told["means"]}
    assert means["x", "good"] == (2, 0.875)
    assert means["y", "bad"] == (1, 1.0)
    alone = next(one for one in told["means"] if one["tasks"] == 1 and one["policy"] == "bad")
    assert alone["interval"] == pytest.approx(
        (0.51, 1.0), abs=0.005
    )  # Wilson's of 4 of 4: one task cannot be drawn twice
    by_policy = {one["engine"]: one for one in told["policies"]}
    assert (by_policy["x"]["seeds"], by_policy["x"]["only_first"], by_policy["x"]["only_second"]) == (8, 6, 0)
    assert by_policy["x"]["p"] == pytest.approx(2 / 2**6)
    together = next(one for one in told["engines"] if one["policy"] is None)
    assert (together["seeds"], together["only_first"], together["only_second"]) == (7, 0, 3)
    # on task a alone both engines have both policies: x orders 0.75 over 0.25, y 0.67 under 1
    over_tasks = next(one for one in told["ranks"] if one["task"] is None)
    assert (over_tasks["kendall"], over_tasks["mmrv"]) == (-1.0, 0.5)
    assert over_tasks["mmrv_reversed"] == pytest.approx(1 / 3)
    # 0.75 and 1 on two tasks, each of which a bootstrap may draw twice; 2 of 3, and 4 of 4
    assert matrix(told) == (
        ("trained on", "x", "y"),
        [["x", "88% (75% to 100%)", "67% (21% to 94%)"], ["y", "12% (0% to 25%)", "100% (51% to 100%)"]],
    )
