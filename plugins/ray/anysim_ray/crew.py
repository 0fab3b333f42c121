"""The workers of one job: what each is at, who takes the next item, and what becomes of that of a lost worker."""

import math
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any, NamedTuple

from anysim.errors import RecordError, TaskError, listing
from anysim_ray import node
from anysim_ray.cluster import room
from anysim_ray.node import BROKE, DONE, LACKING, REFUSED, Place, Worker, packages

WAIT_S = 1.0
"""How long is waited for what workers do before the nodes are counted again [s]."""
BATCH = 256
"""Results that are fetched between two looks at the cluster."""
START_S = 120.0
"""How long a cluster without room for a worker may take to grow, before that ends the job [s]."""
STARTS = 8
"""Workers that may end one after the other without having begun, before that ends the job."""
CLOSE_S = 10.0
"""How long workers may take to close what they opened, at the end [s]."""


class WorkerWarning(RuntimeWarning):
    """A worker was lost; its item is done again."""


class Needs(NamedTuple):
    """What a worker takes of a node, and how often an item is begun at most."""

    cpus: float
    gpus: float
    tries: int


@dataclass
class Task:
    """An item, pickled; `lost` workers so far."""

    number: int
    item: bytes
    lost: int = 0


@dataclass(eq=False)
class Member:
    """A worker: Ray's handle of it, where it is once it has begun, and the item that it is at."""

    actor: Any
    place: Place | None = None
    task: Task | None = None


class Crew:
    """Workers of a cluster, as many as there is room for."""

    def __init__(self, ray: Any, needs: Needs, open_: Callable[[], Any], workers: int | None) -> None:
        self._ray, self._needs, self._most = ray, needs, workers
        ray.cloudpickle.register_pickle_by_value(node)
        self._dumps: Callable[[Any], bytes] = ray.cloudpickle.dumps
        self._remote = ray.remote(num_cpus=needs.cpus, num_gpus=needs.gpus, max_restarts=0)(Worker)
        self._begin = (self._dumps(open_), math.ceil(needs.cpus), str(Path.cwd()), tuple(sys.path))
        self._packages = packages()
        self._lost_by = (
            ray.exceptions.RayActorError,
            ray.exceptions.WorkerCrashedError,
            ray.exceptions.NodeDiedError,
            ray.exceptions.ObjectLostError,
            ray.exceptions.OutOfMemoryError,
        )
        self._asked: dict[Any, Member] = {}
        """By what each has been asked, its beginning or an item."""
        self._idle: list[Member] = []
        self._again: deque[Task] = deque()
        self._failed_starts = 0

    def treat(self, work: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        """Do every item, and yield what came of each once."""
        self._items = enumerate(work)
        whole = False
        try:
            first = list(islice(self._items, max(1, self._limit())))
            self._items, self._exhausted = chain(first, self._items), False
            self._grow(len(first))
            self._counted = self._started = time.monotonic()
            while self._hand_out():
                ready, _ = self._ray.wait(list(self._asked), num_returns=1, timeout=WAIT_S)
                if ready:
                    rest = min(BATCH, len(self._asked))
                    ready, _ = self._ray.wait(list(self._asked), num_returns=rest, timeout=0)
                for ref in ready:
                    yield from self._settle(ref)
                self._count_nodes()
            whole = True
        finally:
            self._end(gently=whole)

    # ------------------------------------------------------------------ workers

    def _limit(self) -> int:
        """Workers that there may be now."""
        there = room(self._ray, self._needs.cpus, self._needs.gpus)
        return there if self._most is None else min(there, self._most)

    @property
    def _members(self) -> int:
        return len(self._asked) + len(self._idle)

    def _grow(self, wanted: int) -> None:
        """Have as many workers; one that has no room yet waits for it in the cluster."""
        for _ in range(wanted - self._members):
            member = Member(self._remote.remote(*self._begin))
            self._asked[member.actor.place.remote()] = member

    def _count_nodes(self) -> None:
        """Grow with the cluster; say so where no worker can ever begin."""
        now = time.monotonic()
        if now - self._counted < WAIT_S:
            return
        self._counted = now
        limit = self._limit()
        if not self._exhausted:
            self._grow(limit)
        begun = self._idle or any(member.place for member in self._asked.values())
        if begun or limit > 0:
            self._started = now
        elif now - self._started > START_S:
            nodes = [f"{one['NodeManagerAddress']} {one['Resources']}" for one in self._ray.nodes() if one["Alive"]]
            raise TaskError(
                f"no node of the cluster has room for a worker of {self._needs.cpus:g} CPUs and {self._needs.gpus:g} "
                f"GPUs: {listing(nodes)}. Add a node, or ask for less, as in --executor ray:num_cpus=0.5"
            )

    def _end(self, gently: bool) -> None:
        members = [*self._idle, *self._asked.values()]
        if gently:
            closing = [member.actor.close.remote() for member in members if member.place]
            if closing:
                self._ray.wait(closing, num_returns=len(closing), timeout=CLOSE_S)
        for member in members:
            with suppress(Exception):  # gone already, or the connection is
                self._ray.kill(member.actor)

    # ------------------------------------------------------------------ items

    def _hand_out(self) -> bool:
        """Give items to those that are idle; whether anything is left to wait for."""
        while self._idle:
            task = self._next()
            if task is None:
                break
            member = self._idle.pop()
            member.task = task
            self._asked[member.actor.treat.remote(task.item)] = member
        return not self._exhausted or bool(self._again) or any(member.task for member in self._asked.values())

    def _next(self) -> Task | None:
        if self._again:
            return self._again.popleft()
        found = next(self._items, None)
        if found is None:
            self._exhausted = True
            return None
        return Task(found[0], self._dumps(found[1]))

    def _settle(self, ref: Any) -> Iterator[Any]:
        """What a worker answered: it has begun, or done an item; or it is lost."""
        member = self._asked.pop(ref)
        try:
            answer = self._ray.get(ref)
        except self._lost_by as error:
            self._lose(member, error)
            return
        if member.task is None:
            self._failed_starts = 0
            member.place = answer
            self._refuse_others(answer)
            self._idle.append(member)
            return
        task, member.task = member.task, None
        kind, what = answer
        where = f"on the node {member.place.node}" if member.place else "on a node"
        if member.place and not member.place.folder:
            where += f", which has no folder {self._begin[2]}"
        if kind == DONE:
            self._idle.append(member)
            self._hand_out()  # before what came of this one is looked at: the worker goes on meanwhile
            yield what
        elif kind == REFUSED:
            raise RecordError(f"{what} ({where})")
        elif kind == LACKING:
            raise RecordError(
                f"the module '{what}' is missing {where}: install there what is installed here, in the same versions"
            )
        else:
            assert kind == BROKE
            raise RuntimeError(f"item {task.number} broke {where}:\n{what}")

    def _lose(self, member: Member, error: Exception) -> None:
        """A worker is gone: its item waits for another one."""
        with suppress(Exception):  # one that does not answer any more may still be at its item
            self._ray.kill(member.actor)
        why = next((line.strip() for line in reversed(str(error).splitlines()) if line.strip()), type(error).__name__)
        if member.place is None:
            self._failed_starts += 1
            self._replace()
            if self._failed_starts >= STARTS:
                raise TaskError(f"{STARTS} workers one after the other ended before they had begun: {why}")
            return
        task = member.task
        if task is None:
            return
        task.lost += 1
        if task.lost >= self._needs.tries:
            raise RecordError(
                f"item {task.number} lost its worker {task.lost} times, the last one on {member.place.node}: {why}. "
                "What was complete is kept, and the same command again goes on from it; if it is no fault of the "
                "nodes, as where memory runs out, give each worker more (--executor ray:num_cpus=2)"
            )
        self._again.append(task)
        self._replace()
        warnings.warn(
            f"a worker on the node {member.place.node} was lost ({why}); item {task.number} is done again",
            WorkerWarning,
            stacklevel=2,
        )

    def _replace(self) -> None:
        """Have a worker in the place of one that is gone, where work is left; without room it waits in the cluster."""
        if self._again or not self._exhausted:
            self._grow(self._members + 1)

    def _refuse_others(self, place: Place) -> None:
        """Results depend on versions: a node has those of this machine, or is refused."""
        if "anysim" not in place.packages:
            raise TaskError(f"the node {place.node} has no anysim; install there what is installed here")
        differing = [
            f"{name} {version} (here {self._packages[name]})"
            for name, version in sorted(place.packages.items())
            if self._packages.get(name, version) != version
        ]
        if differing:
            raise TaskError(
                f"the node {place.node} has other versions: {listing(differing)}; install the same on every node"
            )
