"""Every command that the README shows ends as its comment says; long ones are shortened."""

import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from urllib.request import HTTPCookieProcessor, build_opener

import numpy as np
import pytest

import anysim
from anysim.testing.engines import require_drawing

ROOT = Path(__file__).parents[2]
SHORTER = {
    "--episodes 64": "--episodes 4",
    "--hours 2": "--hours 0.01",
    "run pick_cube --engine sapien": "run pick_cube --engine sapien --episodes 2",
    "shards: 2}'": "shards: 2}' --episodes 2",
    "evaluate pick_cube -e all": "evaluate pick_cube -e all --episodes 4",
    "--steps 2000000": "--steps 4096 --exams 1",
    "core12 --workers 2": "core12 --workers 2 --only reach/*/zero",
    "anysim gallery": "anysim gallery --robots franka_panda --hold 0.1 --random 0.1",
    "-d browser": "-d browser --episodes 1",
}
"""What makes a command end within a minute or two."""


def commands() -> list[str]:
    """Those under "On the command line", without comments, one for each alternative of `a|b|…`."""
    block = re.search(r"^## On the command line\n+```\n(.*?)^```$", (ROOT / "README.md").read_text(), re.M | re.S)
    assert block
    lines = [line.partition("  #")[0].strip() for line in block[1].splitlines() if line.strip()]
    for long, short in SHORTER.items():
        assert any(long in line for line in lines), f"README.md has no longer: {long}"
        lines = [line.replace(long, short) for line in lines]
    alternatives = [(line, re.search(r"\S+\|\S+", line)) for line in lines]
    return [
        line.replace(found[0], word) if found else line
        for line, found in alternatives
        for word in (found[0].split("|") if found else [""])
        if word != "…"
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the commands run, in the order of the page, with the files that they name."""
    path = tmp_path_factory.mktemp("readme")
    (path / "docs").symlink_to(ROOT / "docs")
    shutil.copy(ROOT / "docs" / "worlds" / "kitchen.yaml", path / "my_world.yaml")
    shutil.copy(next((ROOT / "tests" / "external").rglob("third_arm.urdf")), path / "my_arm.urdf")
    return path


def _words(line: str, folder: Path) -> list[str]:
    """The program and its arguments; `runs/…` is the first run, that of the page's first command."""
    if "runs/…" in line:
        runs = _runs(folder)
        if not runs:  # this line was asked for alone
            subprocess.run(_words(commands()[0], folder), cwd=folder, capture_output=True, timeout=900, check=True)
            runs = _runs(folder)
        line = line.replace("runs/…", str(runs[0].relative_to(folder)))
    words = shlex.split(line.replace(" FILE ", " moment.snapshot "))
    return [str(Path(sys.executable).with_name(words[0])), *words[1:]]


def _runs(folder: Path) -> list[Path]:
    """What was recorded there, the first first."""
    return [p.parent for p in sorted((folder / "runs").glob("*/run.json"), key=lambda path: path.stat().st_mtime_ns)]


@pytest.mark.full
@pytest.mark.parametrize("line", commands())
def test_a_command_ends_as_the_page_says(line: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for engine in ("mujoco", "sapien"):
        require_drawing(engine)
    words = _words(line, folder)
    if "browser" in words or words[1] == "view":
        browser = build_opener(HTTPCookieProcessor())  # the token of the address becomes a cookie
        _answers(words, folder, lambda address: browser.open(address).status == 200)
        return
    if "serve" in words:
        monkeypatch.setenv("ANYSIM_STATE_DIR", str(folder / "state"))
        _answers(words, folder, _steps)
        return
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=900, check=False)
    if words[1] == "train" and find_spec("stable_baselines3") is None:
        assert done.returncode != 0
        assert "anysim-learning[sb3]" in done.stderr
        return
    judged = words[1] == "bench" and done.returncode == 1  # a budget of time was missed, beside other work
    assert judged or done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "Traceback" not in done.stderr
    assert done.stdout.strip()


def _steps(address: str) -> bool:
    with anysim.connect(address, task="pick_cube", num_envs=2) as env:
        env.reset(seed=0)
        return env.step(np.zeros((2, env.action_dim))).reward.shape == (2,)


def _answers(words: list[str], folder: Path, asked: Callable[[str], bool]) -> None:
    """It listens on this machine, answers who asks, and an interrupt ends it."""
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            assert process.stdout
            found = next(filter(None, (re.search(r"http://127\.0\.0\.1\S+", line) for line in process.stdout)))
            assert asked(found[0])
            process.send_signal(signal.SIGINT)
            said, _ = process.communicate(timeout=60)
            assert "Traceback" not in said
        finally:
            process.kill()
