"""The executor `processes`: worker processes of this machine."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from typing import TypeVar, TypeVarTuple

from anysim.engine.base import SimEngine
from anysim.engine.executor import Executor
from anysim.threads import usable_cores
from anysim_processes.executors import JobExecutor
from anysim_processes.jobs import treat_all
from anysim_sharded.engine import TIMEOUT_S, sharded
from anysim_sharded.pool import keeping_workers

T = TypeVar("T")
Item = TypeVarTuple("Item")


class Processes(Executor, JobExecutor):
    """Each worker process steps a block of the envs, or does one item of a job after the other."""

    def engine_class(self, inner: type[SimEngine], shards: int, timeout_s: float | None) -> type[SimEngine]:
        return sharded(inner, shards, TIMEOUT_S if timeout_s is None else timeout_s)

    def keeping(self) -> AbstractContextManager[None]:
        return keeping_workers()

    def treat_all(
        self,
        work: Iterable[tuple[*Item]],
        open_: Callable[[], AbstractContextManager[Callable[[*Item], T]]],
        workers: int | None = None,
    ) -> Iterator[T]:
        return treat_all(work, open_, usable_cores() if workers is None else workers)
