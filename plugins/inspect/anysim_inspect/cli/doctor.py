"""`anysim doctor`: what works on this machine, and the remedy for what does not."""

import os
import platform
from typing import TYPE_CHECKING

import typer

from anysim.cli.options import AsJson

if TYPE_CHECKING:
    from anysim.engine.availability import Finding

STYLES = {
    "ok": "green", "note": "dim", "absent": "dim", "missing": "yellow", "unavailable": "red", "wrong": "bold red",
    "broken": "bold red",
}  # fmt: skip

VARIABLES = (
    "ANYSIM_ENGINE",
    "ANYSIM_CACHE_DIR",
    "ANYSIM_PLANNER_SERVICE",
    "MUJOCO_GL",
    "VK_DRIVER_FILES",
    "VK_ICD_FILENAMES",
    "OMP_NUM_THREADS",
)
"""Environment variables that change what anysim or an engine does."""


def doctor(json: AsJson = False) -> None:
    """Check the machine, every installed engine (version, import, physics, rendering, threads), and that plugins load.

    Each fault comes with its remedy. Engines and plugins are tried in processes of their own: one that is missing,
    crashes or hangs costs nothing but its own rows. Exit code 1 if no engine with dynamics works.

    Examples:
      anysim doctor
    """
    from anysim import registry
    from anysim.cli.output import print_json, print_table, working_on
    from anysim.engine.availability import Finding, Health
    from anysim_inspect.engines import examine
    from anysim_inspect.plugins import broken

    rows = machine()
    works = False
    for name in registry.names("engines"):
        with working_on(f"trying {name}"):
            found = examine(name)
        rows += found.findings
        works |= found.works
    with working_on("loading plugins"):
        rows += broken()
    rows += [
        Finding(f"{kind.removesuffix('s')}: {name}", Health.MISSING, "not installed", f"pip install {package}")
        for (kind, name), package in sorted(registry.INSTALL_HINTS.items())
        if package not in registry.participants()
    ]
    if json:
        print_json([row._asdict() for row in rows])
    else:
        print_table("anysim doctor", Finding._fields, rows, STYLES)
    if not works:
        raise typer.Exit(1)


def machine() -> "list[Finding]":
    """Versions, processors, the cache, and the variables that are set."""
    from anysim import __version__
    from anysim.engine.availability import Finding, Health

    rows = [
        Finding("anysim", Health.OK, __version__),
        Finding("python", Health.OK, f"{platform.python_version()} on {platform.system()} {platform.machine()}"),
        Finding("processors", Health.OK, _processors()),
        _cache(),
    ]
    return rows + [Finding(f"${name}", Health.NOTE, os.environ[name]) for name in VARIABLES if os.environ.get(name)]


def _processors() -> str:
    from anysim.threads import usable_cores

    return f"{usable_cores()} usable of {os.cpu_count()}"


def _cache() -> "Finding":
    from anysim.cache import cache_folder
    from anysim.engine.availability import Finding, Health

    folder = cache_folder()
    nearest = next((p for p in (folder, *folder.parents) if p.exists()), folder)
    if os.access(nearest, os.W_OK):
        return Finding("cache", Health.OK, str(folder))
    return Finding(
        "cache", Health.UNAVAILABLE, f"{folder} cannot be written", "set ANYSIM_CACHE_DIR to a folder of yours"
    )
