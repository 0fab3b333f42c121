"""Wheels, built once, and fresh environments that hold nothing but some of them and what these depend on."""

import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from email.parser import HeaderParser
from pathlib import Path

import pytest
from checks.constraints import FILE as CONSTRAINTS
from lock import find_uv
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).parents[2]
EXTERNAL = ROOT / "tests" / "external"
MEMBERS = ("schemas", "core", "backends/*", "plugins/*", "tasks")
"""The packages of the workspace, as the root's pyproject.toml has them."""


def run(
    *command: str | Path, cwd: Path = ROOT, ok: bool = True, timeout: float = 900
) -> subprocess.CompletedProcess[str]:
    """Run a program; one that fails fails the test with what it said, unless that is what the test is about.

    What Python compiles stays in the environments, or each program would compile all that it imports anew.
    """
    words = [str(word) for word in command]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=timeout, check=False, env=environment)
    assert done.returncode == 0 or not ok, f"{' '.join(words)}\n{done.stdout[-8000:]}\n{done.stderr[-4000:]}"
    return done


@pytest.fixture(scope="session")
def program() -> Callable[..., subprocess.CompletedProcess[str]]:
    """See `run`."""
    return run


@pytest.fixture(scope="session")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Wheels of all members, each built from its source distribution."""
    out = tmp_path_factory.mktemp("dist")
    members = [path.parent for pattern in MEMBERS for path in sorted(ROOT.glob(f"{pattern}/pyproject.toml"))]
    python = (find_uv(ROOT), "run", "--quiet", "--no-project", "--isolated", "--with", "hatchling>=1.27")
    run(*python, "--python", sys.executable, "python", Path(__file__).with_name("build_members.py"), out, *members)
    return sorted(out.glob("*.whl"))


@pytest.fixture(scope="session")
def external_wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Wheels of the distributions of `tests/external` by name, built outside of the repository, as their authors do."""
    built: dict[str, Path] = {}
    for source in sorted(EXTERNAL.glob("*/pyproject.toml")):
        folder = tmp_path_factory.mktemp("stranger") / source.parent.name
        shutil.copytree(source.parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
        run(find_uv(ROOT), "build", "--quiet", "--wheel", "--out-dir", folder / "dist", folder, cwd=folder)
        (built[folder.name],) = (folder / "dist").glob("*.whl")
    return built


@pytest.fixture(scope="session")
def environment(wheels: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Makes a fresh environment: `environment("anysim-mujoco", tools=("pytest",))` returns its interpreter.

    It holds the named members, those that they depend on, other wheels, and everything foreign in the versions of
    constraints.txt. Our own names never come from a registry.
    """
    own = {parse_wheel_filename(wheel.name)[0]: wheel for wheel in wheels}

    def make(*members: str, others: tuple[Path, ...] = (), tools: tuple[str, ...] = ()) -> Path:
        uv, venv = find_uv(ROOT), tmp_path_factory.mktemp("env") / "venv"
        chosen, foreign = _closure([own[canonicalize_name(name)] for name in members] + list(others), own)
        run(uv, "venv", "--quiet", "--python", sys.executable, venv)
        python = venv / "bin" / "python"
        install = (uv, "pip", "install", "--quiet", "--python", python)
        run(*install, "--no-deps", *chosen)
        run(*install, "--constraint", ROOT / CONSTRAINTS, *foreign, *tools)
        run(uv, "pip", "check", "--python", python)
        return python

    return make


def _closure(wanted: list[Path], own: dict[str, Path]) -> tuple[list[Path], list[str]]:
    """The wheels and those of ours that they need, and the requirements that are not ours."""
    seen: dict[tuple[Path, str], None] = {}  # wheels with an extra of theirs, or none
    foreign: set[str] = set()
    asked = [(wheel, "") for wheel in wanted]
    while asked:
        one = asked.pop()
        if one in seen:
            continue
        seen[one] = None
        for requirement in _requirements(*one):
            name = canonicalize_name(requirement.name)
            if name in own:
                asked += [(own[name], extra) for extra in ("", *requirement.extras)]
            else:
                requirement.marker = None
                foreign.add(str(requirement))
    return list(dict.fromkeys(wheel for wheel, _ in seen)), sorted(foreign)


def _requirements(wheel: Path, extra: str) -> list[Requirement]:
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        lines = HeaderParser().parsestr(archive.read(name).decode()).get_all("Requires-Dist", [])
    found = map(Requirement, lines)
    return [one for one in found if (one.marker.evaluate({"extra": extra}) if one.marker else not extra)]
