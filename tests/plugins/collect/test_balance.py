"""Shares of the episodes by what tasks cost, and what runs and reports say of them."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from anysim import registry
from anysim.errors import TaskError
from anysim_collect import balance as balances
from anysim_collect.balance import LEAST_SHARE, Cost, balanced, costs_of
from anysim_collect.cli import run as cli
from anysim_collect.mixture import Balance, Part, mixture
from anysim_collect.report import read_report

STORED = {
    "short": {"one": Cost(episodes=10, segments=10, cpu_s=5.0), "two": Cost(episodes=4, segments=3, cpu_s=8.0)},
    "long": {"one": Cost(episodes=20, segments=50, cpu_s=40.0)},
    "poor": {"one": Cost(episodes=8, segments=0, cpu_s=1.0)},
    "dear": {"one": Cost(episodes=1, segments=1, cpu_s=1e4)},
}
app = typer.Typer()
app.command("run")(cli.run)
app.command("report")(cli.report)


@pytest.fixture
def stored(monkeypatch: pytest.MonkeyPatch) -> None:
    def stored_of(task: str) -> dict[str, Cost]:
        return STORED.get(task, {})

    monkeypatch.setattr(balances, "costs_of", stored_of)


def shares(words: list[str], balance: Balance, engine: str = "one") -> dict[str, float]:
    parts = mixture(words)
    return {part.task: part.share for part in balanced(parts, [engine] * len(parts), balance)}


@pytest.mark.usefixtures("stored")
@pytest.mark.parametrize(("balance", "each"), [("segments", (1.0, 2.5)), ("seconds", (0.5, 2.0))])
def test_what_is_balanced_comes_out_by_weight(balance: str, each: tuple[float, float]) -> None:
    equal = shares(["short", "long"], Balance(balance))
    assert equal["short"] * each[0] == pytest.approx(equal["long"] * each[1])
    assert sum(equal.values()) == pytest.approx(1.0)
    thrice = shares(["short=3", "long"], Balance(balance))
    assert thrice["short"] * each[0] == pytest.approx(3 * thrice["long"] * each[1])


@pytest.mark.usefixtures("stored")
def test_episodes_need_no_costs_and_one_task_gets_all() -> None:
    assert shares(["short=3", "unknown"], Balance.EPISODES) == {"short": 0.75, "unknown": 0.25}
    assert balanced([Part("unknown", 1.0)], ["one"], Balance.SECONDS) == [Part("unknown", 1.0)]


@pytest.mark.usefixtures("stored")
def test_no_share_is_too_small_for_an_episode_now_and_then() -> None:
    found = shares(["short", "long", "dear"], Balance.SECONDS)
    assert found["dear"] == LEAST_SHARE
    assert found["short"] == pytest.approx(4 * found["long"]), "the others make room in proportion"
    assert sum(found.values()) == pytest.approx(1.0)
    rare = shares(["short", "long=0.0001"], Balance.SEGMENTS)
    assert rare == pytest.approx({"short": 1 - LEAST_SHARE, "long": LEAST_SHARE})


@pytest.mark.usefixtures("stored")
@pytest.mark.parametrize(
    ("task", "engine", "said"),
    [
        ("unknown", "one", r"'unknown': no costs are stored for it; leave out `--balance segments`"),
        ("long", "two", r"'long': no costs are stored on two \(measured: one\)"),
        ("poor", "one", r"'poor': 8 episodes left none"),
    ],
)
def test_what_was_not_measured_is_not_guessed(task: str, engine: str, said: str) -> None:
    with pytest.raises(TaskError, match=said):
        shares(["short", task], Balance.SEGMENTS, engine)


def test_costs_that_are_stored_can_be_read() -> None:
    known: Mapping[str, Mapping[str, Cost]] = {task: costs_of(task) for task in registry.names("tasks")}
    assert {"mujoco", "pybullet", "sapien"} <= set(known["reach"])
    assert known["put_away"]["mujoco"].segments > known["put_away"]["mujoco"].episodes, "it has several commands"
    assert costs_of("some/file.yaml") == {}


def test_damaged_costs_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "costs.json").write_text('{"spec": "", "engines": {"mujoco": {"episodes": 0}}}')

    def there(task: str) -> Path:
        return tmp_path / "task.yaml"

    monkeypatch.setattr(balances, "task_path", there)
    with pytest.raises(TaskError, match=r"costs\.json is damaged .* install the package of the task 'reach' anew"):
        costs_of("reach")


def anysim(*words: str) -> Any:
    return CliRunner().invoke(app, list(words))


def test_a_run_says_the_shares_and_its_report_what_came_of_them(tmp_path: Path) -> None:
    words = ["reach", "press_button", "--engine", "mujoco", "--balance", "seconds", "--num-envs", "2"]
    done = anysim("run", *words, "--episodes", "6", "-o", "record.cameras=[]", "--out", str(tmp_path))
    assert done.exit_code == 0, done.output
    expected = {part.task: part.share for part in balanced(mixture(words[:2]), ["mujoco"] * 2, Balance.SECONDS)}
    said = ", ".join(f"{task} {share:.1%}" for task, share in expected.items())
    assert f"shares of the episodes, to balance seconds: {said}" in done.output
    mixed = read_report(tmp_path / "reach")["mixture"]
    assert mixed == read_report(tmp_path / "press_button")["mixture"]
    assert mixed["balance"] == "seconds"
    assert {one["task"]: one["share"] for one in mixed["tasks"]} == expected
    assert [one["attempts"] for one in mixed["tasks"]] == [round(6 * share) for share in expected.values()]
    first = mixed["tasks"][0]
    row = f"reach\t{first['share']:.1%}\t{first['attempts']} ({first['attempts'] / 6:.1%})"
    assert row in done.output
    assert all(one["segments"] == one["kept"] and one["cpu_s"] > 0 for one in mixed["tasks"]), "experts of one segment"
    assert "<h2>Mixture</h2>" in (tmp_path / "reach" / "report.html").read_text("utf-8")
    told = anysim("report", str(tmp_path))
    assert told.output.count(row) == 1
    assert "reach on mujoco" in told.output
    assert "press_button on mujoco" in told.output
    assert len(json.loads(anysim("report", str(tmp_path), "--json").output)["runs"]) == 2


def test_weights_alone_share_out_episodes(tmp_path: Path) -> None:
    words = ["reach=2", "press_button", "--num-envs", "1", "--episodes", "3", "-o", "record.cameras=[]"]
    done = anysim("run", *words, "--out", str(tmp_path))
    assert "shares of the episodes, to balance episodes: reach 66.7%, press_button 33.3%" in done.output
    refused = anysim("run", "reach", "no_such_file.yaml", "--balance", "seconds", "--engine", "mujoco")
    assert isinstance(refused.exception, TaskError)
