"""Exact versions: constraints.txt holds one of everything, by name alone, and satisfies every pyproject.toml."""

import re
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from checks.tree import Fault, Tree

FILE = Path("constraints.txt")
PINS = {"mujoco": "3.17.0"}
"""Versions that are chosen, not found: the golden values of the tests were measured with them."""

UNWANTED = frozenset(
    {
        "gymnasium-robotics",
        "lerobot",  # each of its releases wants torch, and other versions of what is pinned here
        "mani-skill",
        "ray",  # 250 MB, for its own tests alone
        "rerun-sdk",  # 800 MB, for its own tests alone
        "rsl-rl-lib",
        "stable-baselines3",
        "tensorboard",
        "torch",
    }
)
LINE = re.compile(r"([a-z0-9][a-z0-9._-]*)==([^\s;]+)( ; .+)?")
REMEDY = "run scripts/lock.py"


def check(tree: Tree) -> Iterator[Fault]:
    """Lines that are not `name==version`, an order that is not alphabetic, and requirements that it does not meet."""
    path = tree.root / FILE
    if not path.is_file():
        yield Fault(FILE, 0, f"missing; {REMEDY}")
        return
    pinned: dict[str, list[str]] = {}
    names: list[str] = []
    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        if line.startswith("#"):
            continue
        found = LINE.fullmatch(line)
        if not found or "://" in line or "@" in line:
            yield Fault(FILE, number, f"'{line}' is not 'name==version' or 'name==version ; marker'; {REMEDY}")
            continue
        name, version = canonicalize_name(found[1]), found[2]
        if names and name < names[-1]:
            yield Fault(FILE, number, f"{name} comes after {names[-1]}; the lines are sorted by name: {REMEDY}")
        if name in UNWANTED:
            yield Fault(FILE, number, f"{name} is not part of the environment of development; {REMEDY}")
        names.append(name)
        pinned.setdefault(name, []).append(version)
    for name, version in PINS.items():
        if pinned.get(name) != [version]:
            yield Fault(FILE, 0, f"{name} must be {version}, is {pinned.get(name)}; {REMEDY}")
    yield from _unmet(tree, pinned)


def _unmet(tree: Tree, pinned: dict[str, list[str]]) -> Iterator[Fault]:
    own = {canonicalize_name(member.project["name"]) for member in tree.members}
    wanted = [(member.folder / "pyproject.toml", r) for member in tree.members for r in member.project["dependencies"]]
    for member in tree.members:
        optional = member.project.get("optional-dependencies", {}).values()
        wanted += [(member.folder / "pyproject.toml", r) for extra in optional for r in extra]
    groups = tree.settings["dependency-groups"].values()
    wanted += [
        (Path("pyproject.toml"), r) for group in groups for r in group if isinstance(r, str)
    ]  # else it includes one
    for source, text in wanted:
        requirement = Requirement(text)
        name = canonicalize_name(requirement.name)
        if name in own or name in UNWANTED:
            continue
        if name not in pinned:
            yield Fault(source, 0, f"{name} is not in {FILE}; {REMEDY}")
        for version in pinned.get(name, []):
            if not requirement.specifier.contains(version, prereleases=True):
                yield Fault(source, 0, f"'{requirement}' excludes {version} of {FILE}; {REMEDY}")
