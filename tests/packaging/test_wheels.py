"""The distributions as users get them: built, installed without the repository, imported."""

import zipfile
from pathlib import Path

import pytest
from checks.tree import Tree
from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).parents[2]
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheels")]  # built once, by one worker

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


@pytest.fixture(scope="module")
def tree() -> Tree:
    return Tree.of(ROOT)


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


def test_installed_packages_import_and_their_entry_points_exist(environment, program, tree: Tree, tmp_path) -> None:
    interpreter = environment(*(member.project["name"] for member in tree.members))
    packages = [member.package for member in tree.members]
    assert program(interpreter, "-I", "-c", SEE_ALL, *packages, cwd=tmp_path).stdout == ""
