"""All workers of an engine: started together, asked together, replaced one by one."""

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from anysim.engine.base import SimEngine
from anysim.errors import AnysimError, EngineError, EngineFailure
from anysim.model.world import World
from anysim_processes.shared_memory import SharedArrays
from anysim_processes.worker_handle import THREAD_POOLS, Worker, WorkerLost
from anysim_sharded.blocks import Blocks

START_S = 300.0
"""The least time to load an engine, to build a world and to draw: a short limit is meant for steps [s]."""

Answers = tuple[dict[int, Any], dict[int, AnysimError], dict[int, WorkerLost]]
"""Results, errors that engines raised, and workers that were lost, by worker."""


def importable_path(engine_class: type[SimEngine]) -> str:
    """`module:Class`, by which a worker finds the class.

    Raises:
        EngineError: it cannot be imported from elsewhere.
    """
    module, name = engine_class.__module__, engine_class.__qualname__
    if module == "__main__" or "<" in name:
        raise EngineError(
            f"the engine class {module}.{name} cannot run in worker processes, which import it anew; "
            f"define it at the top of a module that can be imported"
        )
    return f"{module}:{name}"


class WorkerPool:
    """`count` workers with an engine each. A place whose worker was lost is empty until it is replaced."""

    def __init__(self, path: str, options: Mapping[str, Any], count: int, threads: int, timeout_s: float) -> None:
        if sys.platform == "win32":
            raise EngineError("worker processes need a POSIX system; use shards: 1 on Windows")
        self._path, self._options, self._threads, self._timeout = path, dict(options), threads, timeout_s
        self.kind = self.kind_of(path, options, count, threads, timeout_s)
        """Engines of one kind can have the same workers, one after the other."""
        self._owner = os.getpid()
        self._workers: list[Worker | None] = [None] * count
        # files that an engine keeps go with it even if its worker is killed
        self._folder = Path(tempfile.mkdtemp(prefix="anysim-workers-"))
        try:
            for k in range(count):
                self._start(k)
            self._load(range(count))
        except BaseException:
            self.close()
            raise

    @staticmethod
    def kind_of(path: str, options: Mapping[str, Any], count: int, threads: int, timeout_s: float) -> str:
        """What two pools have in common that can stand in for each other."""
        return repr((path, sorted(options.items()), count, threads, timeout_s))

    def rest(self) -> bool:
        """Have all workers free their worlds; False where one is lost or does not."""
        if os.getpid() != self._owner:
            return False
        messages = {k: ("free", None) for k in range(len(self._workers))}
        answers, _, _ = self.ask(messages, None)
        return len(answers) == len(self._workers)

    @property
    def pids(self) -> tuple[int, ...]:
        """Process ids, -1 for an empty place."""
        return tuple(-1 if worker is None else worker.pid for worker in self._workers)

    def _start(self, k: int) -> None:
        folder = self._folder / str(k)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        limits = {name: str(self._threads) for name in THREAD_POOLS}
        environment = {**limits, **os.environ, "TMPDIR": str(folder)}
        self._workers[k] = Worker(environment, self._timeout, "anysim_sharded.worker")

    def _load(self, places: Iterable[int]) -> None:
        self._settle({k: ("load", None, self._path, self._options) for k in places})

    def build(self, world: World, blocks: Blocks, memory: SharedArrays) -> None:
        """Build each worker's block of envs.

        Raises:
            AnysimError: the first error of a worker.
        """
        everyone = range(len(self._workers))
        empty = [k for k in everyone if self._workers[k] is None]
        for k in empty:
            self._start(k)
        self._load(empty)
        self._settle({k: self._order(world, blocks, memory, k) for k in everyone}, memory.descriptor)

    @staticmethod
    def _order(world: World, blocks: Blocks, memory: SharedArrays, k: int) -> tuple[Any, ...]:
        return ("build", None, world, *blocks.bounds[k], memory.layout)

    def _settle(self, messages: Mapping[int, tuple[Any, ...]], descriptor: int | None = None) -> None:
        """Ask, and raise if anything is wrong."""
        _, raised, lost = self.ask(messages, max(START_S, self._timeout), descriptor)
        for k in lost:
            self.discard(k)
        for k in sorted(lost):
            raise EngineFailure(f"worker {k} {lost[k]} in '{messages[k][0]}'")
        for k in sorted(raised):
            raise raised[k]

    def ask(
        self, messages: Mapping[int, tuple[Any, ...]], limit: float | None, descriptor: int | None = None
    ) -> Answers:
        """Send all messages, then wait for all answers, for `limit` seconds."""
        limit = self._timeout if limit is None else limit
        answers: dict[int, Any] = {}
        raised: dict[int, AnysimError] = {}
        lost: dict[int, WorkerLost] = {}
        asked: dict[int, Worker] = {}
        for k, message in messages.items():
            worker = self._workers[k]
            if worker is None:
                lost[k] = WorkerLost("was lost before")
                continue
            try:
                worker.post(message, descriptor)
                asked[k] = worker
            except WorkerLost as how:
                lost[k] = how
        deadline = time.perf_counter() + limit
        for k, worker in asked.items():
            try:
                answers[k] = worker.answer(deadline, limit)
            except WorkerLost as how:
                lost[k] = how
            except AnysimError as error:
                raised[k] = error
        return answers, raised, lost

    def replace(self, k: int, world: World, blocks: Blocks, memory: SharedArrays) -> None:
        """Start a new worker in place k and build its envs.

        Raises:
            AnysimError: it cannot; the place is empty or useless, `discard` it.
        """
        self.discard(k)
        self._start(k)
        self._load([k])
        self._settle({k: self._order(world, blocks, memory, k)}, memory.descriptor)

    def discard(self, k: int) -> None:
        """End the worker in place k now."""
        worker, self._workers[k] = self._workers[k], None
        if worker is not None:
            worker.kill()

    def close(self) -> None:
        """End all workers: they free their engines; one that does not within seconds is killed."""
        if os.getpid() != self._owner:  # a fork of the owner ends: the workers are not its own
            return
        workers = [worker for worker in self._workers if worker is not None]
        self._workers = [None] * len(self._workers)
        try:
            for worker in workers:
                worker.part()
            for worker in workers:
                worker.close()
        finally:
            for worker in workers:
                worker.kill()
            shutil.rmtree(self._folder, ignore_errors=True)


_kept: dict[str, WorkerPool] | None = None
"""Idle pools by kind; None where none are kept."""


@contextmanager
def keeping_workers() -> Iterator[None]:
    """Within it the workers of an engine that is destroyed wait for the next of its kind; at its end they end."""
    global _kept
    outer = _kept
    _kept = {}
    try:
        yield
    finally:
        idle, _kept = _kept, outer
        for pool in idle.values():
            pool.close()


def take_pool(path: str, options: Mapping[str, Any], count: int, threads: int, timeout_s: float) -> WorkerPool:
    """Idle workers of this kind, or new ones."""
    kind = WorkerPool.kind_of(path, options, count, threads, timeout_s)
    idle = None if _kept is None else _kept.pop(kind, None)
    return WorkerPool(path, options, count, threads, timeout_s) if idle is None else idle


def release_pool(pool: WorkerPool) -> None:
    """Keep a pool where pools are kept and nothing is wrong with it; else end it."""
    if _kept is not None and pool.kind not in _kept and pool.rest():
        _kept[pool.kind] = pool
    else:
        pool.close()
