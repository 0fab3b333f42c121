"""Exit codes of the command line: 1 is an answer, 2 a request that cannot be met, 3 something that broke."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import forked

ROTTEN = {
    "engine.py": """
from anysim.testing.kinematic import NullEngine


class Engine(NullEngine):
    name = "rotten"

    def _build(self, world, num_envs):
        raise ZeroDivisionError("no way")
""",
    "terms.py": """
def raises(scene):
    raise ZeroDivisionError("no way")


TERMS = {"reward": {"raises": raises}}
""",
    "commands.py": """
import typer

from anysim import hooks


@hooks.hookimpl
def add_cli(app):
    @app.command()
    def rot(how: str):
        raise {"error": ZeroDivisionError("no way"), "exit": SystemExit(0), "end": EOFError()}[how]


@hooks.hookimpl
def after_step(env):
    raise ZeroDivisionError("no way")
""",
}
POINTS = """
[anysim]
rotten = anysim_rotten.commands
[anysim.engines]
rotten = anysim_rotten.engine:Engine
[anysim.terms]
rotten = anysim_rotten.terms
"""
BLIND = ["record.cameras=[]", "world.cameras.front.channels=[]", "world.cameras.wrist.channels=[]", "task.horizon=3"]
FAST = ["--engine", "null", *[word for override in BLIND for word in ("-o", override)]]
TERM = ["-o", "task.rewards={rot: {term: rotten.raises}}"]


@pytest.fixture(scope="module")
def rotten(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder from which python finds the distribution anysim-rotten."""
    folder = tmp_path_factory.mktemp("rotten")
    info, package = folder / "anysim_rotten-1.0.dist-info", folder / "anysim_rotten"
    info.mkdir()
    package.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: anysim-rotten\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(POINTS)
    (package / "__init__.py").touch()
    for name, code in ROTTEN.items():
        (package / name).write_text(code)
    return folder


def anysim(*words: str, cwd: Path, plugins: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, **({} if plugins is None else {"PYTHONPATH": str(plugins)})}
    return forked.run("-m", "anysim.cli", *words, cwd=cwd, env=environment)


def ends_with(code: int, words: list[str], folder: Path) -> None:
    """The command's exit code is that of the table, and there is no traceback."""
    done = anysim(*words, cwd=folder)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, ["list", "engines"]),
        (0, ["run", "pick_cube", *FAST]),
        (1, ["run", "pick_cube", *FAST, "--min-success", "0.5"]),
        (0, ["check", "pick_cube"]),
        (1, ["check", "pick_cube", "-o", "physics.dt=-1"]),
        (1, ["check", "no_such_task"]),
        (2, ["run", "no_such_task"]),
        (2, ["run", "pick_cube", "--engine", "warp_drive"]),
        (2, ["run", "pick_cube", "--nothing-like-it"]),
        (2, ["replay", "nowhere"]),
        (2, ["explain", "no_such_task"]),
        (2, ["audit", "no_such_task"]),
        (2, ["snapshot", "show", "nowhere"]),
        (2, ["snapshot", "take", "nowhere", "file"]),
        (2, ["list", "robotz"]),
        (2, ["schema", "nothing"]),
        (2, ["no_such_command"]),
    ],
    ids=lambda value: value if isinstance(value, int) else " ".join(value[:2]),
)
def test_answers_and_requests_that_cannot_be_met(code: int, words: list[str], tmp_path: Path) -> None:
    ends_with(code, words, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, ["doctor"]),
        (2, ["doctor", "--nothing-like-it"]),
        (0, ["compare", "pick_cube", "--engines", "null", "--layers", "asset"]),
        (2, ["compare", "no_such_task"]),
        (2, ["compare", "pick_cube", "--engines", "warp_drive"]),
        (2, ["bench", "no_such_bench"]),
        (2, ["bench", "step", "--engine", "warp_drive"]),
        (2, ["gallery", "--nothing-like-it"]),
        (2, ["render", "nowhere"]),
        (2, ["retarget", "nowhere", "-r", "ur5"]),
        (0, ["robot", "franka_panda"]),
        (2, ["robot", "no_such_robot"]),
        (2, ["robot", "import", "no_such_file.urdf"]),
        (2, ["picture", "no_such_task"]),
    ],
    ids=lambda value: value if isinstance(value, int) else " ".join(value[:2]),
)
def test_commands_of_plugins_keep_the_table(code: int, words: list[str], tmp_path: Path) -> None:
    ends_with(code, words, tmp_path)


@pytest.mark.slow
def test_a_robot_that_fails_its_checks_is_an_answer(tmp_path: Path) -> None:
    """It hangs in the air, on drives that are too weak to hold it."""
    here = Path(__file__).parents[1]
    urdf = (here / "runtime" / "two_link.urdf").read_text().replace('axis xyz="0 0 1"', 'axis xyz="0 1 0"')
    (tmp_path / "two_link.urdf").write_text(urdf)
    entry = (here / "schemas" / "keys" / "two_link.yaml").read_text().replace("../../runtime", str(tmp_path))
    weak = entry.replace("kp: 40, kd: 4", "kp: 0.01, kd: 0.01") + "gravity_compensation: false\n"
    for code, text in ((0, entry), (1, weak)):
        (tmp_path / "two_link.yaml").write_text(text)
        done = anysim("robot", "two_link.yaml", "--check", "--engine", "mujoco", cwd=tmp_path)
        assert done.returncode == code, done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "pick_cube", *FAST, *TERM], "task.rewards.rot: the term 'rotten.raises' of anysim-rotten failed"),
        (["run", "pick_cube", *FAST[2:], "--engine", "rotten"], "something broke in anysim-rotten"),
        (
            ["run", "pick_cube", *FAST, "--strict-observers"],
            "the observer 'rotten' of anysim-rotten failed in after_step",
        ),
        (["audit", "pick_cube", "--engine", "rotten"], "something broke in anysim-rotten"),
        (["rot", "error"], "something broke in anysim-rotten"),
        (["rot", "exit"], "something broke in anysim-rotten"),
        (["rot", "end"], "something broke in anysim-rotten"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, list) else "",
)
def test_what_breaks_is_no_answer_and_names_the_package(
    words: list[str], told: str, rotten: Path, tmp_path: Path
) -> None:
    done = anysim(*words, cwd=tmp_path, plugins=rotten)
    assert done.returncode == 3, done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith("error: ")
    assert told in last
    assert "pip uninstall anysim-rotten" in last


def test_an_observer_that_raises_costs_a_run_nothing(rotten: Path, tmp_path: Path) -> None:
    done = anysim("run", "pick_cube", *FAST, "--json", cwd=tmp_path, plugins=rotten)
    assert done.returncode == 0, done.stderr
    warnings = done.stderr.splitlines()
    assert len(warnings) == 2
    assert warnings[0].startswith("warning: the observer 'rotten' of anysim-rotten failed in after_step: ZeroDivision")
    assert warnings[1] == "warning: the observer 'rotten' of anysim-rotten failed in after_step 3 times in this run"


def test_a_damaged_recording_is_an_answer(tmp_path: Path) -> None:
    recorded = anysim("run", "pick_cube", *FAST, "-o", "record.keep=all", "--out", "runs", cwd=tmp_path)
    assert recorded.returncode == 0, recorded.stderr
    [trajectory] = (tmp_path / "runs" / "episodes").iterdir()
    assert anysim("replay", str(trajectory), cwd=tmp_path).returncode == 0
    with (trajectory / "trajectory.mcap").open("ab") as file:
        file.write(b"more")
    done = anysim("replay", str(trajectory), cwd=tmp_path)
    assert done.returncode == 1
    assert "is damaged" in done.stderr


def test_a_body_that_leaves_the_world_is_counted_apart(tmp_path: Path) -> None:
    place = "world.layout.cube={position: {range: [[0.2, 0, 1], [1.6, 0, 1]]}}"
    done = anysim("run", "pick_cube", *FAST, "-o", "physics.extent=1.1", "-o", place, "-k", "6", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    reasons = [episode["fault"] for episode in told["episodes"]]
    assert 0 < told["faults"] == sum(bool(reason) for reason in reasons) < 6
    assert all(not reason or reason.startswith("'cube' has left the world at 0.02") for reason in reasons)


def test_a_reader_that_leaves_is_no_error(tmp_path: Path) -> None:
    command = f"{sys.executable} -m anysim.cli list robots | head -c 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, done.stderr) == (0, "")
