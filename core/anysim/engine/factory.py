"""Engines by name."""

import os
from typing import Any, Literal

from anysim import registry
from anysim.engine.base import SimEngine
from anysim.errors import EngineError

DEFAULT_ENGINE = "mujoco"
ENGINE_VARIABLE = "ANYSIM_ENGINE"
"""The environment variable that names the engine where neither a file nor the command line does."""


def default_engine() -> str:
    """`ANYSIM_ENGINE` if set, else mujoco. A YAML file and the command line win over it."""
    return os.environ.get(ENGINE_VARIABLE, DEFAULT_ENGINE)


def create_simulation(
    name: str | None = None, *, shards: int | Literal["auto"] = 1, shard_timeout: float | None = None, **options: Any
) -> SimEngine:
    """An engine by name or alias, without a world: `create_simulation("mujoco", threads=2).create_world(world)`.

    Args:
        name: an installed engine; None for the default.
        shards: in how many worker processes it runs, at most one for each env; 1: in this process, auto: one for each
            usable core, but 1 where the engine steps its envs in parallel by itself. Results do not depend on it.
        shard_timeout: the longest [s] that a worker may take for a control step before it counts as lost.
        options: those of the engine.

    Raises:
        PluginError: no such engine; lists what is installed and what could be.
        EngineError: it is installed but cannot run here; says what is missing and the remedy.
    """
    chosen = name or default_engine()
    engine_class: type[SimEngine] = registry.load("engines", chosen)
    here = engine_class.availability()
    if not here.available:
        raise EngineError(f"engine '{chosen}' cannot run here: {'; '.join(here.missing)}. {here.remedy}")
    if shards != 1:
        from anysim.engine.sharded import TIMEOUT_S, sharded
        from anysim.engine.shards.blocks import shard_count

        count = shard_count(shards, engine_class)
        if count != 1:
            engine_class = sharded(engine_class, count, TIMEOUT_S if shard_timeout is None else shard_timeout)
    return engine_class(**options)
