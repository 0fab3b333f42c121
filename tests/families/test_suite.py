"""The suite of families: it clears a right one on every engine, and finds each wrong one by the test named for it."""

import inspect
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.families import paddles

HERE = Path(__file__).parent
WRONG = [
    name
    for name, made in inspect.getmembers(paddles, inspect.isclass)
    if issubclass(made, paddles.Paddle) and made is not paddles.Paddle
]
SUITE = ("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "--pyargs", "anysim.testing.families")


def run(*words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    paths = [str(HERE.parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, *words]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=300, env=environment, cwd=folder, check=False
    )


@pytest.mark.parametrize(
    "engine", ["mujoco", *(pytest.param(name, marks=pytest.mark.slow) for name in ("pybullet", "sapien"))]
)
def test_a_right_family_passes(engine: str, tmp_path: Path) -> None:
    done = run(*SUITE, "--family", "tests.families.paddles:Paddle", "--engine", engine, folder=tmp_path)
    assert done.returncode == 0, done.stdout[-4000:]
    assert re.search(rf"anysim contract: family .*Paddle on {engine}: 9 passed, 0 skipped", done.stdout)


@pytest.mark.slow
def test_the_suite_is_of_one_family(tmp_path: Path) -> None:
    import anysim.testing.families as suite

    where = str(Path(str(suite.__file__)).parent / "test_family.py")
    done = run("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", where, folder=tmp_path)
    assert done.returncode == pytest.ExitCode.USAGE_ERROR
    assert "this suite tests one family" in done.stdout + done.stderr


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """Of all wrong families, in one process."""
    folder = tmp_path_factory.mktemp("wrong")
    jobs = {
        f"{paddles.__name__}:{name}": [f"test_family.py::{inspect.getdoc(getattr(paddles, name))}"] for name in WRONG
    }
    (folder / "jobs.json").write_text(json.dumps(jobs))
    runner = HERE.parent / "contract" / "run_engines.py"
    done = run(str(runner), str(folder / "jobs.json"), str(folder / "results.json"), "families", folder=folder)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr
    found = json.loads((folder / "results.json").read_text())
    return {name.rpartition(":")[2]: tests for name, tests in found.items()}


@pytest.mark.slow
@pytest.mark.xdist_group("wrong families")
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_family_is_found(name: str, outcomes: dict[str, dict[str, str]]) -> None:
    assert outcomes[name]
    assert set(outcomes[name].values()) == {"failed"}, outcomes[name]
