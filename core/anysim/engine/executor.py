"""Executors: where the envs of an engine are stepped, if not in this process (the kind `anysim.executors`)."""

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager, nullcontext
from typing import Literal

from anysim import registry
from anysim.engine.base import SimEngine
from anysim.errors import PluginError
from anysim.threads import usable_cores

PROCESSES = "processes"
"""The executor that `shards` asks for."""


class Executor(ABC):
    """Makes classes of engines that step their envs elsewhere, behind the same interface and with the same results."""

    @abstractmethod
    def engine_class(self, inner: type[SimEngine], shards: int, timeout_s: float | None) -> type[SimEngine]:
        """The class that runs an engine in `shards` parts, at most one for each env.

        Args:
            inner: the engine.
            shards: how many parts.
            timeout_s: the longest [s] that a part may take for a control step before it counts as lost; None: its own.

        Raises:
            EngineError: fewer than one part, or an engine that cannot be had elsewhere.
        """

    def keeping(self) -> AbstractContextManager[None]:
        """Within it what an engine leaves behind serves the next one of its kind; for tests, which make many."""
        return nullcontext()


def executor(name: str = PROCESSES) -> Executor:
    """An installed executor.

    Raises:
        PluginError: unknown, its import failed, or its entry point is no executor.
    """
    found = registry.load("executors", name)
    if not (isinstance(found, type) and issubclass(found, Executor)):
        package = registry.distribution("executors", name)
        raise PluginError(f"the executor '{name}' of {package} is no subclass of anysim.engine.executor.Executor")
    return found()


def shard_count(shards: int | Literal["auto"], engine_class: type[SimEngine], num_envs: int | None = None) -> int:
    """How many parts `shards` means: `auto` is one per usable core, and one for an engine that is parallel itself.

    With `num_envs`, no more than that.
    """
    wanted = shards if isinstance(shards, int) else 1 if engine_class.parallel else usable_cores()
    return wanted if num_envs is None else min(wanted, num_envs)
