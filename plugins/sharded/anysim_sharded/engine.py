"""Engine of k worker processes, of any kind: each steps a contiguous block of the envs, behind the same interface.

Neither PyBullet nor SAPIEN lets threads step in parallel, so processes do. Commands and states go through shared
memory, one short message to each worker and back makes a step. An env's results do not depend on the number of workers.
A worker that dies or hangs costs its own envs their episode, no more: they are marked in `State.fault` until they are
reset, a new worker takes them over, and the rest goes on.
"""

import warnings
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.control import Control
from anysim.engine.state import Availability, ContactPoints, RayHits, SnapshotLevel
from anysim.errors import EngineError, EngineFailure
from anysim.model.world import World
from anysim.threads import usable_cores
from anysim_processes.shared_memory import SharedArrays
from anysim_processes.worker_handle import WorkerLost
from anysim_sharded.blocks import Blocks, joined, joined_by_name, joined_contacts, rows_of, state_layout
from anysim_sharded.hosted import News
from anysim_sharded.pool import START_S, WorkerPool, importable_path, release_pool, take_pool

TIMEOUT_S = 300.0
"""The longest that a worker may take for a control step or another command, but to build or draw, if not set [s]."""


class WorkerWarning(RuntimeWarning):
    """A worker was lost and replaced; its envs are faulted."""


class ShardedEngine(SimEngine):
    """`inner` in worker processes; `sharded` makes the class for an engine. Name and capabilities are the engine's."""

    inner: ClassVar[type[SimEngine]]
    shards: ClassVar[int]
    timeout_s: ClassVar[float]
    parallel: ClassVar[bool] = True

    def __init__(self, **options: Any) -> None:
        """Options are those of the engine."""
        super().__init__(**options)
        self._given = dict(options)
        self._front = self.inner(**options)  # never gets a world; knows what depends on options
        self._pool: WorkerPool | None = None
        self._memory: SharedArrays | None = None
        self._lost = np.zeros(0, dtype=bool)

    @classmethod
    def availability(cls) -> Availability:
        """That of the engine."""
        return cls.inner.availability()

    @classmethod
    def options_model(cls) -> Any:
        """That of the engine."""
        return cls.inner.options_model()

    @classmethod
    def refusals(cls, world: World, options: Any) -> Sequence[str]:
        """Those of the engine."""
        return cls.inner.refusals(world, options)

    @property
    def version(self) -> str:
        """That of the engine: snapshots do not know how many workers there are."""
        return self._front.version

    @property
    def workers(self) -> tuple[int, ...]:
        """The process ids of the workers, in the order of their blocks of envs; empty without a world."""
        return () if self._pool is None else self._pool.pids

    @property
    def lost(self) -> Array:
        """(N,) bool: envs whose worker was lost since their last reset."""
        return self._lost.copy()

    def processor_times(self) -> tuple[float, ...]:
        """Those of the workers."""
        with self._lock:
            self._require_world()
            return tuple(self._ask("processor_time", self._everyone()).values())

    # ------------------------------------------------------------------ lifecycle

    def _build(self, world: World, num_envs: int) -> None:
        fresh = self._pool is None
        if self._pool is None:
            count = min(self.shards, num_envs)
            threads = max(1, usable_cores() // count)
            options = self.inner.share_of_threads(self._given, threads)
            pool = take_pool(importable_path(self.inner), options, count, threads, self.timeout_s)
            self._pool = pool
            self._finalizer = weakref.finalize(self, WorkerPool.close, pool)
            self._blocks = Blocks(num_envs, count)
        count = len(self._blocks.bounds)
        self._lost = np.zeros(num_envs, dtype=bool)
        self._values: dict[str, Array] = {}
        self._fresh: list[set[str]] = [set() for _ in range(count)]
        self._wanted: frozenset[str] = frozenset()
        self._noted: set[str] = set()
        self._news = [News()] * count
        self._pushed = False
        self._memory = SharedArrays(state_layout(world, num_envs))
        try:
            self._pool.build(world, self._blocks, self._memory)
        except BaseException:
            self._let_go(fresh)
            raise

    def _let_go(self, workers_too: bool) -> None:
        if self._memory is not None:
            self._memory.close()
            self._memory = None
        if workers_too and self._pool is not None:
            self._finalizer.detach()
            release_pool(self._pool)
            self._pool = None

    def _free(self) -> None:
        self._let_go(workers_too=False)  # the workers free theirs when they build anew, or end

    def destroy(self) -> None:
        """Free the world and end the workers. May be called any number of times."""
        with self._lock:
            super().destroy()
            self._let_go(workers_too=True)

    # ------------------------------------------------------------------ asking the workers

    def _ask(
        self, name: str, parts: Mapping[int, tuple[Any, ...]], limit: float | None = None, again: bool = True
    ) -> dict[int, Any]:
        """The workers' answers. A lost worker is replaced; with `again` the new one is asked once more.

        Raises:
            AnysimError: what the first worker with an error raised, or a worker that could not be replaced.
        """
        assert self._pool is not None
        if self._commands.control_changed:  # stays so: a later write before the next step must not be missed
            self._apply_control(self._commands.control)
        messages = {k: (name, self._news[k], *arguments) for k, arguments in parts.items()}
        for k in parts:
            self._news[k] = News()
        answers, raised, lost = self._pool.ask(messages, limit)
        for k, how in lost.items():
            self._replace(k, how)
            if again:
                more, errors, gone = self._pool.ask({k: (name, self._spent_news(k), *parts[k])}, limit)
                answers |= more
                raised |= errors
                if gone:
                    raise EngineFailure(f"{self._who(k)} {gone[k]} in '{name}', and so did the one that replaced it")
        if raised:
            raise raised[min(raised)]
        return {k: answers[k] for k in parts if k in answers}  # in their order, also where one took over

    def _spent_news(self, k: int) -> News:
        news, self._news[k] = self._news[k], News()
        return news

    def _who(self, k: int) -> str:
        first, stop = self._blocks.bounds[k]
        envs = f"env {first}" if stop == first + 1 else f"envs {first} to {stop - 1}"
        return f"worker {k} of {self.name} ({envs})"

    def _replace(self, k: int, how: WorkerLost) -> None:
        """A new worker in the place of a lost one: its envs in their initial state, their parameters as they were."""
        assert self._pool is not None
        assert self._memory is not None
        first, stop = self._blocks.bounds[k]
        rows = np.arange(first, stop)
        self._lost[rows] = True
        self._fresh[k].clear()
        self._commands.reset(rows)
        self._memory["wrench"][rows] = 0.0
        self._news[k] = News()
        try:
            self._pool.replace(k, self.world, self._blocks, self._memory)
            for name, arguments in (
                ("populate", (rows - first, self._presence.entities[rows])),
                ("reset", (rows - first,)),
                ("set_parameters", ({name: values[rows] for name, values in self._values.items()},)),
            ):
                _, raised, lost = self._pool.ask({k: (name, News(), *arguments)}, None)
                if raised:
                    raise raised[k]
                if lost:
                    raise lost[k]
        except Exception as error:
            self._pool.discard(k)
            raise EngineFailure(f"{self._who(k)} {how}, and could not be replaced: {error}") from error
        warnings.warn(
            f"{self._who(k)} {how}; a new worker holds these envs in their initial state, faulted until reset(); "
            f"the others go on. If it happens again, look for what these envs do that the engine cannot bear, or give "
            f"it more time or memory",
            WorkerWarning,
            stacklevel=2,
        )

    def _touched(self, workers: Mapping[int, Any]) -> None:
        for k in workers:
            self._fresh[k].clear()

    def _write(self, name: str, parts: Mapping[int, tuple[Any, ...]]) -> None:
        self._touched(parts)
        self._ask(name, parts)

    # ------------------------------------------------------------------ stepping

    def _reset(self, ids: Array) -> None:
        self._write("reset", {p.worker: (p.ids,) for p in self._blocks.split(ids)})
        self._lost[ids] = False

    def _populate(self, ids: Array) -> None:
        rows = self._presence.entities[ids]
        self._write("populate", {p.worker: (p.ids, rows[p.rows]) for p in self._blocks.split(ids)})

    def _step(self, n_steps: int, ids: Array | None) -> None:
        # what was read after the last step will be read after this one: it comes with the answer
        self._wanted, self._noted = frozenset(self._noted), set()
        # with wrenches nothing is read before they are taken away, as without workers
        fields = () if self._pushed else tuple(sorted(self._wanted))
        if ids is None:
            parts = {k: (n_steps, None, fields) for k in range(len(self._blocks.bounds))}
        else:
            parts = {p.worker: (n_steps, p.ids, fields) for p in self._blocks.split(ids)}
        self._touched(parts)
        limit = self.timeout_s * max(1.0, n_steps / self.world.physics.substeps)
        for k in self._ask("step", parts, limit, again=False):
            self._fresh[k].update(fields)

    def _read(self, name: str) -> Array:
        assert self._memory is not None
        self._noted.add(name)
        for fresh in self._fresh:
            if name not in fresh:
                self._fetch(name)
                break
        array = self._memory[name].copy()
        return array | self._lost if name == "fault" else array

    def _fetch(self, name: str) -> None:
        """Have a field written to the shared memory where it is not of this moment, with those that will follow it."""
        stale = [k for k, fresh in enumerate(self._fresh) if name not in fresh]
        parts = {k: (sorted((self._wanted | {name}) - self._fresh[k]),) for k in stale}
        self._ask("read", parts)
        for k, (names,) in parts.items():
            self._fresh[k].update(names)

    def _apply_control(self, control: Control) -> None:
        assert self._memory is not None
        for name in Control._fields:
            self._memory[f"control.{name}"][...] = getattr(control, name)
        self._news = [news._replace(control=True) for news in self._news]

    def _apply_wrench(self, wrench: Array | None) -> None:
        assert self._memory is not None
        if wrench is not None:
            self._memory["wrench"][...] = wrench
        self._pushed = wrench is not None
        self._news = [news._replace(wrench=self._pushed) for news in self._news]

    # ------------------------------------------------------------------ writing

    def _write_joints(self, ids: Array, joints: Array, position: Array | None, velocity: Array | None) -> None:
        parts = self._blocks.split(ids)
        self._write("write_joints", {p.worker: (p.ids, joints, *rows_of(p.rows, position, velocity)) for p in parts})

    def _write_bodies(self, ids: Array, bodies: Array, pose: Array | None, twist: Array | None) -> None:
        parts = self._blocks.split(ids)
        self._write("write_bodies", {p.worker: (p.ids, bodies, *rows_of(p.rows, pose, twist)) for p in parts})

    # ------------------------------------------------------------------ parameters and snapshots

    def _get_parameter(self, name: str) -> Array:
        return np.concatenate(list(self._ask("get_parameter", self._everyone(name)).values()))

    def _everyone(self, *arguments: Any) -> dict[int, tuple[Any, ...]]:
        return dict.fromkeys(range(len(self._blocks.bounds)), arguments)

    def _set_parameter(self, name: str, values: Array, ids: Array, indices: Array) -> None:
        if name not in self._values:
            self._values[name] = np.repeat(self._default_parameter(name)[None], self.num_envs, axis=0)
        parts = self._blocks.split(ids)
        self._write("set_parameter", {p.worker: (name, values[p.rows], p.ids, indices) for p in parts})
        self._values[name][np.ix_(ids, indices)] = values

    def _default_parameter(self, name: str) -> Array:
        return self._ask("default_parameter", {0: (name,)})[0]

    def _snapshot(self, ids: Array, level: SnapshotLevel) -> dict[str, Array]:
        parts = self._blocks.split_query(ids)
        answers = self._ask("snapshot", {p.worker: (p.ids, level) for p in parts})
        return joined_by_name(((p.rows, answers[p.worker]) for p in parts), len(ids))

    @classmethod
    def refuse_rows(cls, data: Mapping[str, Array], level: SnapshotLevel, world: World, options: object) -> None:
        cls.inner.refuse_rows(data, level, world, options)

    def _restore(self, ids: Array, data: Mapping[str, Array], level: SnapshotLevel) -> None:
        parts = self._blocks.split(ids)
        rows = {p.worker: {name: values[p.rows] for name, values in data.items()} for p in parts}
        self._lost[ids] = False  # before: a worker lost on the way has not got the snapshot's commands
        self._write("restore", {p.worker: (p.ids, rows[p.worker], level) for p in parts})

    def _carry_rows(self) -> Any:
        self._ask("carry", self._everyone())  # what is carried stays in the workers
        return self._lost.copy()

    def _take_rows(self, carried: Any, old: World) -> None:
        self._write("take", self._everyone())
        self._lost |= carried

    def read_back(self) -> Mapping[str, Array]:
        """What the engine says of env 0."""
        with self._lock:
            self._require_world()
            return self._ask("read_back", {0: ()})[0]

    def handles(self) -> Mapping[str, int]:
        """Those of the engine, over all workers."""
        with self._lock:
            self._require_world()
            answers = list(self._ask("handles", self._everyone()).values())
            return {name: sum(answer[name] for answer in answers) for name in answers[0]}

    # ------------------------------------------------------------------ sensing

    def renderer_name(self) -> str:
        """What draws the images."""
        with self._lock:
            return self._front.renderer_name() if self._pool is None else self._ask("renderer_name", {0: ()})[0]

    def _render(self, view: CameraView, ids: Array, channels: tuple[str, ...]) -> dict[str, Array]:
        parts = self._blocks.split_query(ids)
        orders = {
            p.worker: (
                replace(view, pose=view.pose[p.rows], fov=view.fov[p.rows], body_pose=view.body_pose[p.rows]),
                p.ids,
                channels,
            )
            for p in parts
        }
        answers = self._ask("render", orders, max(START_S, self.timeout_s))  # the first image may compile shaders
        return joined_by_name(((p.rows, answers[p.worker]) for p in parts), len(ids))

    def _raycast(self, origins: Array, directions: Array, ids: Array) -> RayHits:
        parts = self._blocks.split_query(ids)
        answers = self._ask("raycast", {p.worker: (origins[p.rows], directions[p.rows], p.ids) for p in parts})
        return RayHits(*(joined([(p.rows, answers[p.worker][i]) for p in parts], len(ids)) for i in range(2)))

    def _contacts(self, ids: Array) -> ContactPoints:
        parts = self._blocks.split_query(ids)
        answers = self._ask("contacts", {p.worker: (p.ids,) for p in parts})
        return joined_contacts([(ContactPoints(*answers[p.worker]), p) for p in parts], self._blocks, ids)


@cache
def sharded(engine_class: type[SimEngine], shards: int, timeout_s: float = TIMEOUT_S) -> type[ShardedEngine]:
    """The class that runs an engine in `shards` worker processes, at most one for each env.

    Raises:
        EngineError: fewer than one, or a class that a worker cannot import.
    """
    if shards < 1 or timeout_s <= 0.0:
        raise EngineError(f"shards must be at least 1 and timeout_s more than 0, got {shards} and {timeout_s:g}")
    importable_path(engine_class)
    body = {
        "__doc__": f"{engine_class.__name__} in worker processes.",
        "__module__": __name__,
        "inner": engine_class,
        "shards": shards,
        "timeout_s": timeout_s,
        "name": engine_class.name,
        "capabilities": engine_class.capabilities,
        "parameters": engine_class.parameters,
        "ragged_rows": engine_class.ragged_rows,
        "lifecycle": engine_class.lifecycle,
    }
    return type(f"Sharded{engine_class.__name__}", (ShardedEngine,), body)
