"""Packages of strangers on the path, as an installer leaves them: without building a wheel."""

import os
import shutil
import subprocess
import tomllib
from pathlib import Path

from tests import forked

EXTERNAL = Path(__file__).parent / "external"
FOUND = """
import json, sys
from anysim.registry import KINDS, distribution, load, names
own = {kind: [name for name in names(kind) if distribution(kind, name) == sys.argv[1]] for kind in KINDS}
assert all(load(kind, name) is not None for kind, found in own.items() for name in found)
print(json.dumps({kind: found for kind, found in own.items() if found}))
"""
"""A program that loads all that a distribution offers to anysim, and prints its names by kind."""


def offered(name: str) -> dict[str, list[str]]:
    """The names that the distribution `tests/external/NAME` declares, by kind."""
    declared = tomllib.loads((EXTERNAL / name / "pyproject.toml").read_text())["project"]["entry-points"]
    return {group.removeprefix("anysim."): sorted(rows) for group, rows in declared.items() if group != "anysim"}


def install(name: str, folder: Path) -> Path:
    """Put the distribution `tests/external/NAME` into a folder, with its metadata and entry points."""
    source = EXTERNAL / name
    project = tomllib.loads((source / "pyproject.toml").read_text())["project"]
    package = name.replace("-", "_")
    shutil.copytree(source / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    info = folder / f"{package}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {project['version']}\n")
    groups = [
        f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(groups))
    return folder


def run(folder: Path, *words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run Python with the folder on its path."""
    return forked.run(*words, cwd=cwd, env={**os.environ, "PYTHONPATH": str(folder)})
