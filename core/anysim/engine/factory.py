"""Engines by name: installed ones, those that can run here, and new simulations."""

import os
from contextlib import suppress
from typing import Any, Literal

from anysim import registry
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability
from anysim.engine.state import Availability
from anysim.errors import EngineError, PluginError

DEFAULT_ENGINE = "mujoco"
ENGINE_VARIABLE = "ANYSIM_ENGINE"
"""The environment variable that names the engine where neither a file nor the command line does."""


def default_engine() -> str:
    """`ANYSIM_ENGINE` if set, else mujoco. A YAML file and the command line win over it."""
    return os.environ.get(ENGINE_VARIABLE, DEFAULT_ENGINE)


def engine_class(name: str) -> type[SimEngine]:
    """The class of an installed engine.

    Raises:
        PluginError: unknown, its import failed, or its entry point is no engine; names the distribution and the cause.
    """
    found = registry.load("engines", name)
    if not (isinstance(found, type) and issubclass(found, SimEngine)):
        problem = "is no subclass of anysim.engine.base.SimEngine"
    elif not isinstance(getattr(found, "capabilities", None), Capabilities):
        problem = "declares no capabilities"
    else:
        return found
    entry = registry.entry("engines", name)
    raise PluginError(f"the engine '{name}' of {registry.distribution('engines', name)} {problem} ({entry.value})")


def availability(name: str) -> Availability:
    """Whether an installed engine can run here, as it says itself.

    Raises:
        PluginError: as `engine_class`, or it broke its promise to answer; names the distribution and the cause.
    """
    found, package = engine_class(name), registry.distribution("engines", name)
    unsure = f"the engine '{name}' of {package} does not know whether it can run here"
    try:
        here = found.availability()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise PluginError(f"{unsure}: {registry.in_words(error)}; {registry.remedy(package)}") from error
    if isinstance(here, Availability):
        return here
    raise PluginError(f"{unsure}: availability() returned a {type(here).__name__}; {registry.remedy(package)}")


def runnable(*capabilities: Capability) -> tuple[str, ...]:
    """The installed engines that can run here and have these capabilities, sorted; one that does not load is left out.

    `anysim list engines` says why an engine is not among them.
    """
    found: list[str] = []
    for name in registry.names("engines"):
        with suppress(PluginError):
            if availability(name).available and all(c in engine_class(name).capabilities for c in capabilities):
                found.append(name)
    return tuple(found)


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
        PluginError: no such engine, or nothing that makes shards; lists what is installed and what could be. Or it
            does not load; says why.
        EngineError: it is installed but cannot run here; says what is missing and the remedy.
    """
    chosen = name or default_engine()
    here = availability(chosen)
    if not here.available:
        raise EngineError(f"engine '{chosen}' cannot run here: {'; '.join(here.missing)}. {here.remedy}")
    simulation = engine_class(chosen)
    if shards != 1:
        from anysim.engine.executor import executor, shard_count

        count = shard_count(shards, simulation)
        if count != 1:
            simulation = executor().engine_class(simulation, count, shard_timeout)
    with registry.using("engines", chosen):
        return simulation(**options)
