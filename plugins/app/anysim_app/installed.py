"""Installed engines, tasks with their pictures, and robots, as a person is told of them."""

import sys
from functools import lru_cache
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.api import load, task_path
from anysim.assets.catalogue import load_robot, missing_source
from anysim.engine.factory import availability, engine_class
from anysim.errors import AnysimError


@lru_cache(maxsize=1)
def engines() -> list[dict[str, Any]]:
    """Each installed engine: whether it runs here, its version, or what is missing."""
    rows = []
    for name in registry.names("engines"):
        here = availability(name)
        words = _about(engine_class(name)) if here.available else here.remedy
        rows.append({"name": name, "available": here.available, "version": here.version, "words": words})
    return rows


def _about(made: type) -> str:
    """The first paragraph of a docstring, or of its module's where it refers to that."""
    words = made.__doc__ or ""
    if words.startswith("See the module"):
        words = sys.modules[made.__module__].__doc__ or ""
    return " ".join(words.split("\n\n")[0].replace("`", "").split())


def runnable() -> list[str]:
    """The engines that run here."""
    return [row["name"] for row in engines() if row["available"]]


@lru_cache(maxsize=1)
def tasks() -> dict[str, dict[str, Any]]:
    """Each installed task by name; one that does not load says why."""
    found: dict[str, dict[str, Any]] = {}
    for name in registry.names("tasks"):
        row: dict[str, Any] = {"name": name, "family": task_path(name).parent.parent.name.replace("_", " ")}
        try:
            spec = load(name).spec
        except AnysimError as error:
            found[name] = row | {"words": f"does not load: {error}", "expert": False, "robots": [], "engine": ""}
            continue
        task = spec.task
        solved = spec.collect is not None or (task is not None and task.expert is not None)
        words = "" if task is None else task.description
        robots = sorted({robot.robot for robot in spec.world.robots.values()})
        found[name] = row | {"words": words, "expert": solved, "robots": robots, "engine": spec.engine.name}
    return found


def picture(task: str) -> Path | None:
    """The picture of an installed task, where its package has one."""
    path = task_path(task).with_name("picture.jpg") if task in tasks() else None
    return path if path is not None and path.is_file() else None


def source(task: str) -> str:
    """The YAML of an installed task."""
    return task_path(task).read_text("utf-8")


@lru_cache(maxsize=1)
def robots() -> list[dict[str, Any]]:
    """Each robot of the catalogue: its kind, words and licence, and whether its files are here."""
    rows = []
    for name in registry.names("robots"):
        entry = load_robot(name)
        spec = entry.spec
        about = {"name": name, "kind": spec.category, "words": spec.description, "licence": spec.license}
        rows.append(about | {"missing": missing_source(entry) or ""})
    return rows
