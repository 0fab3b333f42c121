"""Executors of jobs: where long commands have their items of work done, as `--executor NAME` says.

An executor is an entry point of the group `anysim.executors`: a class derived from `JobExecutor` that is made with
keyword-only options. The same name may step envs as well (`anysim.engine.executor.Executor`).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import Any, TypeVar, TypeVarTuple

import yaml

from anysim import registry
from anysim.errors import PluginError, TaskError
from anysim.plugin_parameters import checked, options_model, parameters
from anysim_processes.jobs import treat_all

T = TypeVar("T")
Item = TypeVarTuple("Item")


class JobExecutor(ABC):
    """Does items of work in workers, each of which opens once what does them."""

    @abstractmethod
    def treat_all(
        self,
        work: Iterable[tuple[*Item]],
        open_: Callable[[], AbstractContextManager[Callable[[*Item], T]]],
        workers: int | None = None,
    ) -> Iterator[T]:
        """Do something with every item; yields what came of each once, in any order, as it comes.

        An item whose worker is lost is done again. It may have been done in part, or whole without a word of it: what
        does items leaves nothing half done behind, or passes over what it finds.

        Args:
            work: the items, taken as workers are free for them; it may end early.
            open_: gives what does an item. It, the items and what comes of them are pickled; a worker imports the
                modules that they name.
            workers: at most so many; None: as many as there is room for.

        Raises:
            RecordError: an item was refused with an error of anysim, or the workers cannot be had, in a sentence.
        """


def share(
    executor: str | None,
    work: Iterable[tuple[*Item]],
    open_: Callable[[], AbstractContextManager[Callable[[*Item], T]]],
    workers: int | None = None,
) -> Iterator[T]:
    """Do items by the executor of this name; without one in `workers` processes of this machine, by default in this."""
    if executor is None:
        return treat_all(work, open_, workers or 1)
    return job_executor(executor).treat_all(work, open_, workers)


def job_executor(text: str) -> JobExecutor:
    """The executor of `NAME` or `NAME:KEY=VALUE,KEY=VALUE`.

    Raises:
        TaskError: the text has another form.
        PluginError: none of this name is installed, or it does no jobs.
        SpecError: at `executor.KEY`, an option that it does not take, or of another kind.
    """
    name, options = _parsed(text)
    made = registry.load("executors", name)
    if not (isinstance(made, type) and issubclass(made, JobExecutor)):
        package = registry.distribution("executors", name)
        raise PluginError(
            f"the executor '{name}' of {package} does no jobs: it is no subclass of "
            "anysim_processes.executors.JobExecutor"
        )
    given = checked(options_model(made), options, "executor")
    return made(**{key: getattr(given, key) for key in parameters(made)})


def _parsed(text: str) -> tuple[str, dict[str, Any]]:
    name, colon, rest = text.partition(":")
    options: dict[str, Any] = {}
    for pair in rest.split(",") if colon else ():
        key, equals, value = pair.partition("=")
        if not name or not equals or not key.isidentifier() or key in options:
            raise TaskError(
                f"--executor {text}: expected NAME or NAME:KEY=VALUE,… with each key once, as in ray:num_cpus=2"
            )
        options[key] = yaml.safe_load(value) if value.replace(".", "", 1).isdigit() else value
    return name, options
