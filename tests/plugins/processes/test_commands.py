"""Commands with `--executor`: what they write is what they write in this process, byte by byte but for clocks."""

import json
import shutil
from contextlib import chdir
from pathlib import Path
from typing import Any

import pytest
from typer import Typer
from typer.testing import CliRunner

from anysim.record.names import MANIFEST_FILE
from anysim.testing.engines import require_drawing
from anysim_annotation.sheet import SHEET_FILE
from anysim_evaluation.benchmark.freezing import freeze
from anysim_evaluation.benchmark.protocol import load_protocol
from anysim_film.sheet import FILM_FILE
from anysim_processes import executors
from tests.plugins.processes.pickling import Pickling

pytestmark = pytest.mark.slow
WORLD = """
world:
  objects:
    table: {source: {box: [1.0, 1.2, 0.04]}, fixed: true}
    ball: {source: {sphere: 0.07}, label: toy, color: {choice: [yellow, red]}}
  layout:
    table: {position: [0.5, 0.0, 0.38]}
    ball: {on: table, x: {range: [0.25, 0.75]}, y: {range: [-0.35, 0.35]}}
  cameras:
    eye: {from: [1.2, 0.5, 1.0], look_at: [0.5, 0, 0.4], fov: 50, size: [48, 36]}
"""
STILLS = "{source: desk.yaml, engine: mujoco, images: 5, batch: 2, formats: [coco]}"
PROTOCOL = """name: tiny
tasks: {short: {task: reach, horizon: 6}}
engines: {mujoco: {}}
policies: {zero: zero, random: {policy: random, trained_on: mujoco}}
reference: {engine: mujoco, policy: random}
seeds: {split: validation, episodes: 4}
control_rate: 50
num_envs: 2
"""
SMALL = ["world.cameras.front.size=[48, 36]", "record.cameras=[]", "record.keep=all", "task.horizon=6"]
TIMES = {"clock", "wall_s"}


def short_run(command_line: Typer, out: Path) -> Path:
    """Two short episodes without images."""
    require_drawing("mujoco")
    overrides = [word for one in SMALL for word in ("-o", one)]
    words = ["run", "pick_cube", "-n", "2", "-k", "2", *overrides, "--out", str(out), "-e", "mujoco"]
    done = CliRunner().invoke(command_line, words)
    assert done.exit_code == 0, done.output
    return out


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, command_line: Typer) -> Path:
    return short_run(command_line, tmp_path_factory.mktemp("recorded") / "run")


@pytest.fixture(autouse=True)
def pickling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "job_executor", lambda name: Pickling())
    Pickling.items = 0


def without_times(value: Any) -> Any:
    """A sheet without its clocks."""
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if key not in TIMES}
    return [without_times(one) for one in value] if isinstance(value, list) else value


def contents(folder: Path) -> dict[str, Any]:
    """What the files of a folder hold, by path, but for times and for what says how a run went."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if not path.is_file() or path.name in ("cost.jsonl", "costs.json", ".lock"):
            continue
        if path.name in (MANIFEST_FILE, SHEET_FILE, FILM_FILE):
            found[name] = without_times(json.loads(path.read_text()))
        elif path.suffix == ".jsonl":  # a log, in the order in which episodes came
            lines = [without_times(json.loads(line)) for line in path.read_text().splitlines()]
            found[name] = sorted(lines, key=lambda line: line.get("seed", -1))
        else:
            found[name] = path.read_bytes()
    return found


def written(words: list[str], command_line: Typer, run: Path, here: Path) -> dict[str, Any]:
    """What a command leaves in a folder with a run, a job of stills and a protocol; RUN and OUT stand for places."""
    here.mkdir()
    for file, text in (("desk.yaml", WORLD), ("stills.yaml", STILLS), ("tiny.yaml", PROTOCOL)):
        (here / file).write_text(text)
    freeze(load_protocol(str(here / "tiny.yaml")))
    shutil.copytree(run, here / "run")
    before = len(contents(here))
    with chdir(here):
        done = CliRunner().invoke(command_line, [{"RUN": "run", "OUT": "out"}.get(word, word) for word in words])
    assert done.exit_code == 0, (done.output, done.exception)
    found = contents(here)
    assert len(found) > before
    return found


@pytest.mark.parametrize(
    ("words", "items"),
    [
        (["render", "RUN", "-c", "front"], 2),
        (["render", "RUN", "-c", "front", "--size", "32", "24", "--out", "OUT"], 2),
        (["render", "RUN", "-c", "front", "--annotate", "boxes_2d"], 2),
        (["render", "stills.yaml", "--out", "OUT"], 3),
        (["export", "RUN", "--to", "robomimic", "--option", "images=false", "--failed-too", "--out", "OUT"], 2),
        (["evaluate", "reach", "-e", "mujoco", "-p", "random", "-k", "4", "-n", "2", "--out", "OUT"], 2),
        (["benchmark", "run", "tiny.yaml", "--out", "OUT"], 4),
    ],
    ids=lambda value: f"{value[0]}_{value[-1].lstrip('-').lower()}" if isinstance(value, list) else str(value),
)
def test_an_executor_changes_nothing(
    words: list[str], items: int, command_line: Typer, recorded: Path, tmp_path: Path
) -> None:
    alone = written(words, command_line, recorded, tmp_path / "alone")
    assert Pickling.items == 0
    assert written([*words, "--executor", "pickling"], command_line, recorded, tmp_path / "shared") == alone
    assert Pickling.items == items
