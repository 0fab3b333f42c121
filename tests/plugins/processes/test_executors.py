"""Executors of jobs: how one is named, what a stranger's must be, and what its work does."""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import pytest

from anysim import registry
from anysim.errors import PluginError, RecordError, SpecError, TaskError
from anysim_processes.executors import JobExecutor, job_executor, share
from anysim_processes.jobs import treat_all
from anysim_sharded.executor import Processes


class Backwards(JobExecutor):
    """A stranger's: in this process, the last item first."""

    def __init__(self, *, at_most: int = 100) -> None:
        self.at_most = at_most

    def treat_all(
        self,
        work: Iterable[tuple[Any, ...]],
        open_: Callable[[], AbstractContextManager[Callable[..., Any]]],
        workers: int | None = None,
    ) -> Iterator[Any]:
        with open_() as treat:
            for item in list(work)[: self.at_most][::-1]:
                yield treat(*item)


@pytest.fixture
def stranger(monkeypatch: pytest.MonkeyPatch) -> None:
    known = registry.load
    offered = {"backwards": Backwards, "nothing": int}
    monkeypatch.setattr(registry, "load", lambda kind, name: offered.get(name) or known(kind, name))
    monkeypatch.setattr(registry, "distribution", lambda kind, name: "anysim-stranger")


@contextmanager
def doubling() -> Iterator[Callable[[int], int]]:
    yield lambda number: 2 * number


@contextmanager
def dying() -> Iterator[Callable[[int], int]]:
    yield lambda number: os._exit(1) if number == 3 else number


@pytest.mark.usefixtures("stranger")
def test_an_executor_is_an_entry_point_with_options() -> None:
    work = [(1,), (2,), (3,)]
    assert list(share(None, work, doubling)) == [2, 4, 6]
    assert list(share("backwards", work, doubling)) == [6, 4, 2]
    assert list(share("backwards:at_most=2", work, doubling)) == [4, 2]
    with pytest.raises(SpecError, match=r"executor.much"):
        job_executor("backwards:much=2")
    with pytest.raises(SpecError, match=r"executor.at_most"):
        job_executor("backwards:at_most=few")
    with pytest.raises(PluginError, match=r"'nothing' of anysim-stranger does no jobs"):
        job_executor("nothing")


@pytest.mark.parametrize("text", ["ray:", "ray:address", "ray:a=1,a=2", ":a=1"])
def test_what_is_no_executor_is_refused(text: str) -> None:
    with pytest.raises(TaskError, match="expected NAME or NAME:KEY=VALUE"):
        job_executor(text)


def test_the_processes_of_this_machine_are_one() -> None:
    made = job_executor("processes")
    assert isinstance(made, Processes)
    assert list(made.treat_all([(1,), (2,)], doubling, 1)) == [2, 4]
    with pytest.raises(PluginError, match="no executor named 'slurm'"):
        job_executor("slurm")


def test_items_are_taken_as_they_are_done() -> None:
    taken: list[int] = []

    def work() -> Iterator[tuple[int]]:
        for number in range(3):
            taken.append(number)
            yield (number,)

    done = treat_all(work(), doubling)
    assert next(done) == 0
    assert taken == [0]
    assert list(done) == [2, 4]


@pytest.mark.slow
def test_a_process_that_dies_ends_the_work_in_words() -> None:
    with pytest.raises(RecordError, match="a worker process died"):
        list(treat_all([(number,) for number in range(8)], dying, 2))
