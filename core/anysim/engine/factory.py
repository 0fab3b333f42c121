"""Engines by name."""

import os
from typing import Any

from anysim import registry
from anysim.engine.base import SimEngine
from anysim.errors import EngineError

DEFAULT_ENGINE = "mujoco"
ENGINE_VARIABLE = "ANYSIM_ENGINE"
"""The environment variable that names the engine where neither a file nor the command line does."""


def default_engine() -> str:
    """`ANYSIM_ENGINE` if set, else mujoco. A YAML file and the command line win over it."""
    return os.environ.get(ENGINE_VARIABLE, DEFAULT_ENGINE)


def create_simulation(name: str | None = None, **options: Any) -> SimEngine:
    """An engine by name or alias, without a world: `create_simulation("mujoco", threads=2).create_world(world)`.

    Raises:
        PluginError: no such engine; lists what is installed and what could be.
        EngineError: it is installed but cannot run here; says what is missing and the remedy.
    """
    chosen = name or default_engine()
    engine_class: type[SimEngine] = registry.load("engines", chosen)
    here = engine_class.availability()
    if not here.available:
        raise EngineError(f"engine '{chosen}' cannot run here: {'; '.join(here.missing)}. {here.remedy}")
    return engine_class(**options)
