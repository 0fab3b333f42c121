"""Findings of `anysim doctor` about the machine itself."""

import os
import platform
from pathlib import Path

from anysim import __version__
from anysim.cache import cache_folder
from anysim.engine.doctor import Finding, Health
from anysim.engine.factory import ENGINE_VARIABLE

VARIABLES = (ENGINE_VARIABLE, "ANYSIM_CACHE_DIR", "MUJOCO_GL", "VK_DRIVER_FILES", "VK_ICD_FILENAMES", "OMP_NUM_THREADS")
"""Environment variables that change what anysim or an engine does."""


def machine() -> list[Finding]:
    """Versions, processors, the cache, and the variables that are set."""
    rows = [
        Finding("anysim", Health.OK, __version__),
        Finding("python", Health.OK, f"{platform.python_version()} on {platform.system()} {platform.machine()}"),
        Finding("processors", Health.OK, _processors()),
        _cache(),
    ]
    return rows + [Finding(f"${name}", Health.NOTE, os.environ[name]) for name in VARIABLES if os.environ.get(name)]


def _processors() -> str:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{usable} usable of {os.cpu_count()}"


def _cache() -> Finding:
    folder: Path = cache_folder()
    nearest = next((p for p in (folder, *folder.parents) if p.exists()), folder)
    if os.access(nearest, os.W_OK):
        return Finding("cache", Health.OK, str(folder))
    return Finding(
        "cache", Health.UNAVAILABLE, f"{folder} cannot be written", "set ANYSIM_CACHE_DIR to a folder of yours"
    )
