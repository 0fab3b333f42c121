"""The executor `processes`: worker processes of this machine."""

from contextlib import AbstractContextManager

from anysim.engine.base import SimEngine
from anysim.engine.executor import Executor
from anysim_sharded.engine import TIMEOUT_S, sharded
from anysim_sharded.pool import keeping_workers


class Processes(Executor):
    """Each worker process steps a block of the envs."""

    def engine_class(self, inner: type[SimEngine], shards: int, timeout_s: float | None) -> type[SimEngine]:
        return sharded(inner, shards, TIMEOUT_S if timeout_s is None else timeout_s)

    def keeping(self) -> AbstractContextManager[None]:
        return keeping_workers()
