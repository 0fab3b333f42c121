"""The contract of external benchmarks: their tasks, an environment of one, its steps and its verdict.

A benchmark is an entry point of the group `anysim.benchmarks`: a class that is made without arguments. It imports the
package that it speaks for when it is made, and not before.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from anysim import registry
from anysim.conventions import Array
from anysim.errors import TaskError, listing, suggest
from anysim.task.contract import Obs

SEPARATOR = ":"
"""Between the name of a benchmark and that of its task, as in `maniskill:PickCube-v1`."""


class ExternalStep(NamedTuple):
    """What one step gave.

    Attributes:
        obs: as of `reset`.
        reward: of this step.
        terminated: the episode is over, by whatever rule; the verdict says how.
    """

    obs: Obs
    reward: float
    terminated: bool


class ExternalEnv(Protocol):
    """One environment of an external benchmark.

    Attributes:
        low, high: (A,) bounds of the action; infinite where there are none.
        horizon: steps after which an episode is truncated.
    """

    low: Array
    high: Array
    horizon: int

    def reset(self, seed: int) -> Obs:
        """Begin the episode of a seed; arrays by name, without an axis of envs."""
        ...

    def step(self, action: Array) -> ExternalStep:
        """One step with an action (A,) within the bounds."""
        ...

    def verdict(self) -> bool:
        """Whether the task is solved now, by the benchmark's own rule."""
        ...

    def close(self) -> None:
        """Release what it holds."""
        ...


class Benchmark(Protocol):
    """An external benchmark.

    Attributes:
        version: of the package that it comes from, as `mani_skill 3.0.1`; episodes of two versions are not mixed.
    """

    version: str

    def tasks(self) -> Sequence[str]:
        """The names of its tasks that have a verdict."""
        ...

    def make(self, task: str) -> ExternalEnv:
        """An environment of one of `tasks()`."""
        ...


def is_external(task: str) -> bool:
    """Whether a task's name is BENCHMARK:TASK, rather than a file's or DISTRIBUTION:TASK of our own."""
    name, separator, rest = task.partition(SEPARATOR)
    if not separator or rest.endswith((".yaml", ".yml")) or not name.replace("-", "_").isidentifier():
        return False
    return name in registry.names("benchmarks") or name not in registry.participants()


def open_task(task: str) -> tuple[Benchmark, ExternalEnv]:
    """The benchmark and an environment of BENCHMARK:TASK.

    Raises:
        PluginError: there is no such benchmark, or its package is not installed.
        TaskError: it has no such task.
    """
    name, _, wanted = task.partition(SEPARATOR)
    benchmark: Benchmark = registry.load("benchmarks", name)()
    names = benchmark.tasks()
    if wanted not in names:
        raise TaskError(
            f"the benchmark '{name}' ({benchmark.version}) has no task '{wanted}'{suggest(wanted, list(names))} "
            f"(its tasks: {listing(names, 100)})"
        )
    return benchmark, benchmark.make(wanted)
