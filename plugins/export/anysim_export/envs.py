"""Envs of recorded runs, in which their episodes begin anew."""

from collections.abc import Mapping
from typing import Any

from anysim.task.env import TaskEnv


def env_of(spec: Mapping[str, Any], engine: str | None = None) -> TaskEnv:
    """One env of a run, by its resolved spec; with another engine in place of the recorded one, with its defaults."""
    from anysim.api import make

    plain: dict[str, Any] = {**spec, "num_envs": 1}
    if engine is not None and engine != plain["engine"]["name"]:
        plain["engine"] = {"name": engine}
    return make(plain, curriculum=True)
