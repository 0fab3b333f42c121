"""MuJoCo 4 as `mujoco-core`: an environment that has it in the place of `mujoco`, as docs/install.md says."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from checks.constraints import FILE as CONSTRAINTS
from lock import find_uv

pytestmark = [pytest.mark.full, pytest.mark.xdist_group("mujoco-core")]  # made once, by one worker

ROOT = Path(__file__).parents[2]
CORE = "mujoco-core==4.0.1"
WITHOUT = "mujoco ; sys_platform == 'never'\n"
FOLDERS = ("tests/backends/mujoco", "tests/plugins/soft", "tests/engine/test_availability.py")


@pytest.fixture(scope="module")
def python(program: Callable[..., CompletedProcess[str]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The interpreter of an environment with all members of the workspace, the tools of tests, and mujoco-core."""
    uv, folder = find_uv(ROOT), tmp_path_factory.mktemp("core")
    program(uv, "venv", "--quiet", "--python", sys.executable, folder / "venv")
    interpreter = folder / "venv" / "bin" / "python"
    install = (uv, "pip", "install", "--quiet", "--python", interpreter)
    done = program(*install, "--no-deps", CORE, ok=False)
    if done.returncode:
        pytest.skip(f"{CORE} cannot be had here: {done.stderr.strip().splitlines()[-1]}")
    (folder / "without.txt").write_text(WITHOUT)
    own = [f"{path.parent}{'[all]' * (path.parent.name == 'core')}" for path in sorted(ROOT.glob("*/pyproject.toml"))]
    own += [str(path.parent) for path in sorted([*ROOT.glob("backends/*/*.toml"), *ROOT.glob("plugins/*/*.toml")])]
    words = ("--constraint", ROOT / CONSTRAINTS, "--override", folder / "without.txt", "--group", "test")
    program(*install, *words, *(word for one in own for word in ("--editable", one)), CORE)
    return interpreter


def test_the_engine_is_there_with_its_version(python: Path, program: Callable[..., CompletedProcess[str]]) -> None:
    rows = json.loads(program(python.with_name("anysim"), "list", "engines", "--json").stdout)
    assert {row["name"]: row["what"] for row in rows}["mujoco"] == CORE.partition("==")[2]


def test_the_tests_of_the_backend_and_of_soft_matter_pass(
    python: Path, program: Callable[..., CompletedProcess[str]]
) -> None:
    words = ("-m", "pytest", "-n", "0", "-p", "no:cacheprovider", "-m", "not slow and not full", *FOLDERS)
    done = program(python, *words, timeout=3600)
    assert " passed" in done.stdout.splitlines()[-1]
