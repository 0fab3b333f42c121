"""The distributions as users get them: built, installed without the repository, imported."""

import subprocess
import sys
import zipfile
from email.parser import HeaderParser
from pathlib import Path

import pytest
from checks.constraints import FILE as CONSTRAINTS
from checks.tree import Tree
from lock import find_uv
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow

SEE_ALL = """
import importlib, importlib.util, sys
from importlib import metadata
for package in sys.argv[1:]:
    module = importlib.import_module(package)
    assert "site-packages" in module.__file__, module.__file__
missing = []
for dist in metadata.distributions():
    for entry in dist.entry_points if dist.name.startswith("anysim") else ():
        try:
            found = importlib.util.find_spec(entry.module)
        except ModuleNotFoundError:
            found = None
        if found is None:
            missing.append(f"{dist.name}: {entry.group} {entry.name} = {entry.value}")
print(*missing, sep="\\n", end="")
"""


def call(*command: str | Path, cwd: Path = ROOT) -> str:
    """Run a program, show what it says if it fails, and return what it printed."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def tree() -> Tree:
    return Tree.of(ROOT)


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Wheels of all members, each built from its source distribution."""
    out = tmp_path_factory.mktemp("dist")
    call(find_uv(ROOT), "build", "--quiet", "--all-packages", "--out-dir", out)
    return sorted(out.glob("*.whl"))


@pytest.fixture(scope="module")
def interpreter(wheels: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment with the wheels and what they depend on. Our own names never come from a registry."""
    uv, venv = find_uv(ROOT), tmp_path_factory.mktemp("env") / "venv"
    call(uv, "venv", "--quiet", "--python", sys.executable, venv)
    python = venv / "bin" / "python"
    install = (uv, "pip", "install", "--quiet", "--python", python)
    call(*install, "--no-deps", *wheels)
    call(*install, "--constraint", ROOT / CONSTRAINTS, *_foreign_requirements(wheels))
    call(uv, "pip", "check", "--python", python)
    return python


def _foreign_requirements(wheels: list[Path]) -> list[str]:
    own = {parse_wheel_filename(wheel.name)[0] for wheel in wheels}
    found: set[str] = set()
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
            lines = HeaderParser().parsestr(archive.read(name).decode()).get_all("Requires-Dist", [])
        for requirement in map(Requirement, lines):
            if requirement.marker is None and canonicalize_name(requirement.name) not in own:
                found.add(str(requirement))
    return sorted(found)


def test_there_is_one_wheel_for_each_member(wheels: list[Path], tree: Tree) -> None:
    built = [parse_wheel_filename(wheel.name)[0] for wheel in wheels]
    assert sorted(built) == sorted(canonicalize_name(member.project["name"]) for member in tree.members)


def test_a_wheel_holds_every_file_of_its_package_and_nothing_else(wheels: list[Path], tree: Tree) -> None:
    for member in tree.members:
        source = member.folder / member.package
        expected = {path.relative_to(member.folder).as_posix() for path in tree.files if path.is_relative_to(source)}
        (wheel,) = (wheel for wheel in wheels if wheel.name.startswith(f"{member.package}-"))
        with zipfile.ZipFile(wheel) as archive:
            held = {name for name in archive.namelist() if ".dist-info/" not in name}
        assert held == expected


def test_installed_packages_import_and_their_entry_points_exist(interpreter: Path, tree: Tree, tmp_path: Path) -> None:
    missing = call(interpreter, "-I", "-c", SEE_ALL, *(member.package for member in tree.members), cwd=tmp_path)
    assert missing == ""
