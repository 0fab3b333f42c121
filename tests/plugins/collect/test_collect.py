"""`anysim run` with several tasks and limits, and what its reports say."""

import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest
import typer
from typer.testing import CliRunner

from anysim.errors import RecordError, TaskError
from anysim.planning.service import ServiceCounts
from anysim_collect import mixture as mixtures
from anysim_collect.cli import run as cli
from anysim_collect.mixture import Limits, Part, mixture, parse_bytes, shared_out
from anysim_collect.page import page
from anysim_collect.report import read_report, report_of, write_report
from anysim_collect.tally import Tally
from anysim_collect.turns import Collection, collect
from anysim_recording.collector import EpisodeResult

WORLDS = Path(__file__).parents[1] / "skills/worlds"
DRAWN, BEHIND_WALL = (str(WORLDS / name) for name in ("drawn_commands.yaml", "behind_wall.yaml"))
app = typer.Typer()
app.command("run")(cli.run)
app.command("report")(cli.report)
RUN = {"task": "t", "engine": "e", "engine_version": "e 1", "num_envs": 2, "seed": 0}


def anysim(*words: str) -> Any:
    return CliRunner().invoke(app, list(words))


def test_a_mixture_is_tasks_with_weights() -> None:
    assert mixture(["pick_cube=3", "push_cube"]) == [Part("pick_cube", 0.75), Part("push_cube", 0.25)]
    for words, said in ((["a=0"], "'a=0'"), (["a=much"], "'a=much'"), (["=2"], "'=2'"), (["a", "a=2"], "named twice")):
        with pytest.raises(TaskError, match=said):
            mixture(words)


@pytest.mark.parametrize(
    ("weights", "episodes", "counts"),
    [((3, 1), 64, [48, 16]), ((1, 1, 1), 10, [4, 3, 3]), ((9, 1), 1, [1, 0]), ((1, 1), 3, [2, 1])],
)
def test_episodes_are_shared_out_whole(weights: Sequence[int], episodes: int, counts: list[int]) -> None:
    parts = [Part(str(k), w / sum(weights)) for k, w in enumerate(weights)]
    assert shared_out(parts, episodes) == counts


@pytest.mark.parametrize(("text", "size"), [("500MB", 5e8), ("2 GB", 2e9), ("1000", 1000), ("1.5k", 1500)])
def test_sizes_are_decimal(text: str, size: float) -> None:
    assert parse_bytes(text) == size


@pytest.mark.parametrize("text", ["", "GB", "-1", "0", "5 MiB"])
def test_what_is_no_size_is_refused(text: str) -> None:
    with pytest.raises(TaskError, match="expected a size such as"):
        parse_bytes(text)


def test_limits_end_a_collection(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(mixtures.time, "monotonic", lambda: now[0])
    limits = Limits(hours=1.0, max_bytes=1000)
    assert limits.reached() == ""
    now[0] += 3500.0
    assert limits.reached() == ""
    limits.kept = 1000
    assert limits.reached() == "1,000 bytes"
    now[0] += 200.0
    assert limits.reached() == "1 hours"


def result(status: str = "success", steps: int = 10, **outcome: Any) -> EpisodeResult:
    path = Path("x") if status == "success" else None
    return EpisodeResult(0, 0, 1, status, steps, 1.0, outcome, path)


def segment(number: int, skill: str) -> dict[str, Any]:
    return {"segment": number - 1, "command": number, "skill": skill, "attempt": 1, "first_step": 1, "last_step": 2}


def counted() -> Tally:
    tally = Tally()
    both = [segment(1, "open"), segment(2, "close")]
    tally.add(result(phase="2 close: retreat", command=2, segments=both, outcome="ok"), 500)
    ladder = ["no_ik -> candidate", "no_ik -> give up"]
    failed = {"phase": "2 close: reach", "command": 2, "segments": both[:1], "outcome": "no_ik", "ladder": ladder}
    tally.add(result("failed", **failed))
    tally.add(result("truncated", phase="1 open: pull", command=1, segments=[], outcome="running"))
    return tally


def test_a_tally_tells_commands_and_failures_apart() -> None:
    told = counted().to_dict()
    assert (told["attempts"], told["successes"], told["kept"], told["kept_bytes"]) == (3, 1, 1, 500)
    assert told["segments"] == 2, "those of the trajectory that is kept"
    assert told["failures"] == {"no_ik": 1, "truncated": 1}
    assert told["ladder"] == {"no_ik -> candidate": 1, "no_ik -> give up": 1}
    first, second = told["commands"]
    assert (first["command"], first["begun"], first["succeeded"]) == ("1 open", 3, 2)
    assert first["failures"] == {"truncated": 1}
    assert (second["command"], second["begun"], second["succeeded"]) == ("2 close", 2, 1)
    assert second["failures"] == {"no_ik": 1}


def test_an_expert_is_one_command_and_a_lost_episode_is_no_attempt() -> None:
    tally = Tally()
    tally.add(result(skill="pick", phase="bring: carry", outcome="ok"))
    tally.add(EpisodeResult(0, 1, 1, "failed", 0, 0.0, {}, lost=True))
    told = tally.to_dict()
    assert (told["attempts"], told["lost"], told["segments"]) == (1, 1, 1)
    assert [(c["command"], c["begun"]) for c in told["commands"]] == [("pick", 1)]


def test_a_report_is_written_whole_and_read_again(tmp_path: Path) -> None:
    told = report_of(RUN, counted(), {"physics": 1.0, "policy": 3.0}, 2.5) | {"planning": {"requests": 4}}
    path = write_report(tmp_path, told)
    assert read_report(tmp_path) == json.loads(json.dumps(told))
    assert read_report(tmp_path)["cpu_s_per_kept"] == 2.5
    text = path.read_text("utf-8")
    root = ElementTree.fromstring(text.partition("\n")[2])
    assert [h.text for h in root.iter("h2")] == ["By command", "Failures", "Retries", "Where the time went", "Planning"]
    assert page(told) == text
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(RecordError, match="is no report of the format"):
        read_report(tmp_path)
    with pytest.raises(RecordError, match="is not there"):
        read_report(tmp_path / "elsewhere")


def test_a_report_of_nothing_is_a_page(tmp_path: Path) -> None:
    assert "no attempt" in write_report(tmp_path, report_of(RUN, Tally(), {}, 0.0)).read_text("utf-8")


def test_run_and_report_from_the_command_line(tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = [
        "run",
        DRAWN,
        "--num-envs",
        "4",
        "--episodes",
        "4",
        "--seed",
        "3",
        "--out",
        str(out),
        "-o",
        "record.keep=segments",
    ]
    done = anysim(*words, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    report = read_report(out)
    assert (report["attempts"], report["kept"]) == (4, sum(e["path"] is not None for e in told["episodes"]))
    assert report["kept"] > report["successes"], "some are kept for their segments alone"
    for episode in told["episodes"]:
        assert (episode["path"] is not None) == (episode["status"] == "success" or bool(episode["outcome"]["segments"]))
    again = anysim(*words)  # resumes what is kept, and runs the rest anew
    assert again.exit_code == 0
    assert "resuming" in again.output
    assert read_report(out)["commands"] == report["commands"]
    said = anysim("report", str(out))
    assert "1 open" in said.output


def test_planning_is_counted_apart(tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = anysim("run", BEHIND_WALL, "--num-envs", "2", "--episodes", "2", "--seed", "3", "--out", str(out))
    assert done.exit_code == 0, done.output
    report = read_report(out)
    planning = report["planning"]
    assert planning["requests"] == planning["answered"] > 0
    assert planning["CPU [s]"] > 0.0
    assert report["cpu_s"] > 0.0
    assert "<h2>Planning</h2>" in (out / "report.html").read_text("utf-8")
    assert "waited for" in anysim("report", str(out)).output
    counts = [ServiceCounts(submitted=5, answered=3, processor=1.5), ServiceCounts(submitted=1, processor=0.5)]
    services = [SimpleNamespace(counts=counts[0], beside=False), SimpleNamespace(counts=counts[1], beside=True)]
    told = report_of(RUN, Tally(), {}, 4.0, services)  # pyright: ignore[reportArgumentType]
    assert (told["cpu_s"], told["planning"]["CPU [s]"]) == (2.5, 2.0), "processes of their own were not in it"
    assert [count.queue for count in counts] == [2, 1]


def test_a_limit_of_bytes_ends_a_run(tmp_path: Path) -> None:
    words = ["run", "reach", "--num-envs", "2", "--bytes", "1", "--out", str(tmp_path), "-o", "record.cameras=[]"]
    done = anysim(*words)
    assert done.exit_code == 0, done.output
    assert "ended at the limit of 1 bytes" in done.output
    assert 1 <= read_report(tmp_path)["attempts"] < 200


def manifests(folder: Path) -> dict[str, Any]:
    """What the manifests below a folder say, but for their clocks."""
    said = {str(path.relative_to(folder)): json.loads(path.read_text()) for path in folder.rglob("manifest.json")}
    return {place: {k: v for k, v in manifest.items() if k != "clock"} for place, manifest in said.items()}


def test_several_tasks_have_a_directory_each_and_are_what_they_are_alone(tmp_path: Path) -> None:
    quick = ["-o", "record.cameras=[]", "--num-envs", "2", "--json"]
    done = anysim("run", "reach=2", "press_button=1", *quick, "--episodes", "3", "--out", str(tmp_path / "both"))
    assert done.exit_code == 0, done.output
    assert [run["attempts"] for run in json.loads(done.output)["runs"]] == [2, 1]
    assert {path.name for path in (tmp_path / "both").iterdir()} == {"reach", "press_button"}
    alone = tmp_path / "alone"
    assert anysim("run", "reach", *quick, "--episodes", "2", "--out", str(alone)).exit_code == 0
    assert manifests(tmp_path / "both/reach") == manifests(alone) != {}


class Paced(Collection):
    """A collection of nothing, with episodes of some steps."""

    def __init__(self, share: float, steps: int, total: int | None, order: list[float]) -> None:
        self.share, self.total, self.tally = share, total, Tally()
        self._steps, self._order, self._made = steps, order, 0

    def advance(self, show: Any) -> bool:
        self._order.append(self.share)
        self._made += 1
        if self._made % self._steps == 0:
            self.tally.add(result())
        return len(self._order) < 400


def test_turns_go_round_or_follow_the_shares() -> None:
    order: list[float] = []
    collect([Paced(0.25, 2, 9, order), Paced(0.75, 5, 9, order)], lambda one, ended: None)
    assert order[:6] == [0.25, 0.75] * 3
    order.clear()
    rare, often = Paced(0.25, 2, None, order), Paced(0.75, 5, None, order)
    collect([rare, often], lambda one, ended: None)
    assert often.tally.attempts == pytest.approx(3 * rare.tally.attempts, abs=3), "though its episodes are longer"
