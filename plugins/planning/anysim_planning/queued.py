"""A planner service's desk: requests in queues, answers in the order of submission, workers that are replaced.

Requests of one tick are grouped by their joints and goals; a worker takes a large part of a group at first and small
ones towards its end, so that all end together.
"""

from abc import abstractmethod
from collections import deque
from dataclasses import dataclass, field
from itertools import groupby
from threading import Condition, Thread
from time import perf_counter

from anysim.errors import AnysimError
from anysim.planning.motion import PlanAnswer, PlanRequest, PlanStatus, Scene
from anysim.planning.service import PlanFuture, PlannerService

GRACE = 0.5
"""[s] beyond its deadline after which a planner that does not return is given up, and its worker replaced."""
WARM_UP_LIMIT = 120.0
"""[s] in which a worker makes its planner, loads and compiles, before the clock of its first request begins."""
CLOSING = 2.0
"""[s] that the end of a worker is waited for."""
MOTIONS, BATCH = 32, 256
"""Requests that a worker takes at once, at most: motions, and joint positions, which take a hundredth of their time."""


@dataclass(eq=False)
class Seat:
    """A worker: its thread, the requests that it has not answered yet, and since when it has the first."""

    thread: Thread = field(init=False)
    jobs: list[PlanFuture] = field(default_factory=list)
    since: float = 0.0
    retired: bool = False

    @property
    def hangs(self) -> bool:
        """Whether it is beyond a deadline, or has not begun for longer than warming up may take."""
        now = perf_counter()
        if not self.jobs:
            return False
        patience = WARM_UP_LIMIT + sum(future.request.deadline for future in self.jobs)  # they may be planned together
        return now > min(self.since + patience, *(future.budget.end + GRACE for future in self.jobs))


class QueuedService(PlannerService):
    """Worker threads around what answers requests. A kind of service writes `_work`."""

    def __init__(self, workers: int) -> None:
        """`workers` of them begin at once.

        Raises:
            AnysimError: fewer than one.
        """
        super().__init__()
        if workers < 1:
            raise AnysimError(f"a planner service needs at least one worker, got {workers}")
        self._changed = Condition()
        self._pending: list[PlanFuture] = []  # of this tick
        self._queue: deque[list[PlanFuture]] = deque()
        self._waiting: list[PlanFuture] = []  # submitted and not harvested, in order
        self._closed = False
        self._seats = [self._started() for _ in range(workers)]

    def submit(
        self, request: PlanRequest, scene: Scene, *, env: int | None = None, now: int = 0, latency: int | None = 0
    ) -> PlanFuture:
        """Ask; see `PlannerService`."""
        request.check()
        future = PlanFuture(self, request, scene, env, None if latency is None else now + latency)
        with self._changed:
            if self._closed:
                raise AnysimError("the planner service is closed; make a new one")
            self._supersede(future)
            self._pending.append(future)
            self._waiting.append(future)
            self.counts.submitted += 1
        return future

    def flush(self) -> None:
        """Hand the requests of this tick to the workers, similar ones together."""
        with self._changed:
            self._replace_the_hung()
            asked, self._pending = [f for f in self._pending if not f.done], []
            self._queue.extend(list(group) for _, group in groupby(sorted(asked, key=_likeness), key=_likeness))
            if asked:
                self._changed.notify_all()

    def harvest(self, now: int) -> list[PlanFuture]:
        """The futures that take effect at control step `now`, in the order of their submission; waits for late ones."""
        self.flush()
        due = [f for f in self._waiting if (f.done if f.due is None else f.due <= now)]
        for future in due:
            if not future.done:
                self.counts.late += 1
                begun = perf_counter()
                self.wait(future)
                self.counts.waited += perf_counter() - begun
        taken = set(map(id, due))
        self._waiting = [f for f in self._waiting if id(f) not in taken]
        return due

    def wait(self, future: PlanFuture) -> PlanAnswer:
        """The answer of a future of this service."""
        self.flush()
        with self._changed:
            while future.answer is None:
                self._replace_the_hung()
                self._changed.wait(0.02)
            return future.answer

    def cancel(self, future: PlanFuture) -> bool:
        """Answer `cancelled`, and ask its planner to stop."""
        with self._changed:
            return self._cancelled(future, "the caller gave it up")

    def close(self) -> None:
        """Cancel what is under way and end the workers; a thread that hangs in a planner ends when that returns."""
        with self._changed:
            self._closed = True
            self._ending()
            for future in self._waiting:
                self._cancelled(future, "the service was closed")
            self._queue.clear()
            self._changed.notify_all()
            seats = list(self._seats)
        for seat in seats:
            seat.thread.join(CLOSING)

    # ------------------------------------------------------------------ workers

    @abstractmethod
    def _work(self, seat: Seat) -> None:
        """The thread of a worker: answer what `_next` gives, until that is None."""

    def _supersede(self, newer: PlanFuture) -> None:
        """Under the lock: what an env asked for before in this tick, of the same kind and joints, has no use any more.

        What was flushed stays: whether a worker has begun it depends on the machine.
        """
        for older in self._pending if newer.env is not None else ():
            if older.env == newer.env and _subject(older.request) == _subject(newer.request):
                self._cancelled(older, f"env {newer.env} asked anew for the same joints before it began")

    def _stop(self, seat: Seat, future: PlanFuture) -> None:
        """Under the lock: a request that a worker has was given up, as its budget says."""

    def _ending(self) -> None:
        """Under the lock: the service was closed."""

    def _replace_the_hung(self) -> None:
        """Under the lock, with every flush and while a call waits."""

    def _started(self) -> Seat:
        seat = Seat()
        seat.thread = Thread(target=self._work, args=(seat,), name="anysim-planner", daemon=True)
        seat.thread.start()
        return seat

    def _next(self, seat: Seat, limit: float | None = None) -> list[PlanFuture] | None:
        """What a worker is to answer next; nothing yet after `limit` [s], None for nothing ever."""
        with self._changed:
            seat.jobs = []
            while not self._queue and not self._closed and not seat.retired:
                if not self._changed.wait(limit):
                    return []
            if self._closed or seat.retired:
                return None
            group = self._queue[0]
            share = min(MOTIONS if group[0].request.path else BATCH, -(-len(group) // (2 * len(self._seats))))
            seat.jobs = [future for future in group[:share] if not future.done]
            del group[:share]
            if not group:
                self._queue.popleft()
            seat.since = perf_counter()
            return list(seat.jobs)

    def _give(self, seat: Seat, answer: PlanAnswer, processor: float) -> None:
        """Answer the first of a worker's requests, which took that much processor time [s]."""
        with self._changed:
            self.counts.processor += processor
            if not seat.retired:
                self._answer(seat.jobs.pop(0), answer)
                seat.since = perf_counter()

    def _answer(self, future: PlanFuture, answer: PlanAnswer) -> bool:
        """Under the lock: the first answer stands."""
        if future.answer is not None:
            return False
        future.answer = answer
        self.counts.answered += 1
        self.counts.cancelled += answer.status is PlanStatus.CANCELLED
        self._changed.notify_all()
        return True

    def _cancelled(self, future: PlanFuture, why: str) -> bool:
        future.budget.cancel()
        for seat in self._seats:
            if future in seat.jobs:
                self._stop(seat, future)
        return self._answer(future, PlanAnswer(PlanStatus.CANCELLED, message=why))


def overdue() -> PlanAnswer:
    """The answer for a planner that does not come back."""
    return PlanAnswer(PlanStatus.TIMEOUT, message="the planner did not return by its deadline")


def _subject(request: PlanRequest) -> tuple[object, ...]:
    return request.kind, request.joints


def _likeness(future: PlanFuture) -> tuple[object, ...]:
    request = future.request
    goals = tuple(
        (g.robot, g.tool, len(g.poses), g.position_tolerance, g.rotation_tolerance, g.rotation_weight, g.slide)
        for g in request.goals
    )
    return request.kind, request.joints, goals, request.straight is None
