"""The planner service `threads`: worker threads that have planners of their own.

Requests of one tick are grouped by their joints and goals, and each group is shared between the threads.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from threading import Condition, Thread
from time import perf_counter

from anysim import registry
from anysim.errors import AnysimError
from anysim.model.world import World
from anysim.planning.motion import MotionPlanner, PlanAnswer, PlanRequest, PlanStatus, Scene, motion_planner
from anysim.planning.service import PlanFuture, PlannerService

GRACE = 0.5
"""[s] beyond its deadline after which a planner that does not return is given up, and its thread replaced."""


@dataclass(eq=False)
class _Worker:
    jobs: Sequence[PlanFuture] = ()
    give_up_at: float = float("inf")
    retired: bool = False
    thread: Thread = field(init=False)


class ThreadedService(PlannerService):
    """Worker threads around planners; a thread that hangs or dies is replaced."""

    def __init__(self, world: World, planner: str | Callable[[], MotionPlanner] = "rrt", threads: int = 1) -> None:
        """`planner`: a name, or what makes one; each thread makes its own.

        Raises:
            AnysimError: fewer threads than one.
            PluginError: there is no planner of that name.
        """
        super().__init__()
        if threads < 1:
            raise AnysimError(f"a planner service needs at least one thread, got {threads}")
        if isinstance(planner, str):
            registry.entry("planners", planner)  # the name of none is an error here, not in a thread
        make = partial(motion_planner, world, planner) if isinstance(planner, str) else planner
        self._make, self._changed = make, Condition()
        self._pending: list[PlanFuture] = []  # of this tick
        self._queue: deque[list[PlanFuture]] = deque()
        self._waiting: list[PlanFuture] = []  # submitted and not harvested, in order
        self._workers: list[_Worker] = []
        self._closed = False
        self._workers = [self._started() for _ in range(threads)]

    def submit(
        self, request: PlanRequest, scene: Scene, *, env: int = 0, now: int = 0, latency: int | None = 0
    ) -> PlanFuture:
        """Ask; see `PlannerService`."""
        request.check()
        future = PlanFuture(self, request, scene, env, None if latency is None else now + latency)
        with self._changed:
            if self._closed:
                raise AnysimError("the planner service is closed; make a new one")
            self._pending.append(future)
            self._waiting.append(future)
            self.counts.submitted += 1
        return future

    def flush(self) -> None:
        """Hand the requests of this tick to the threads, similar ones together."""
        with self._changed:
            asked, self._pending = [f for f in self._pending if not f.done], []
            for _, group in groupby(sorted(asked, key=_likeness), key=_likeness):
                alike = list(group)
                share = -(-len(alike) // len(self._workers))
                self._queue.extend(alike[i : i + share] for i in range(0, len(alike), share))
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
                self._give_up_the_hung()
                self._changed.wait(0.02)
            return future.answer

    def cancel(self, future: PlanFuture) -> bool:
        """Answer `cancelled`, and ask its planner to stop."""
        future.budget.cancel()
        with self._changed:
            return self._answer(future, PlanAnswer(PlanStatus.CANCELLED, message="the caller gave it up"))

    def close(self) -> None:
        """Cancel what is under way and end the threads; one that hangs in a planner ends when the planner returns."""
        with self._changed:
            self._closed = True
            for future in self._waiting:
                future.budget.cancel()
                self._answer(future, PlanAnswer(PlanStatus.CANCELLED, message="the service was closed"))
            self._queue.clear()
            self._changed.notify_all()
            workers = list(self._workers)
        for worker in workers:
            worker.thread.join(GRACE)

    # ------------------------------------------------------------------ threads

    def _started(self) -> _Worker:
        worker = _Worker()
        worker.thread = Thread(target=self._work, args=(worker,), name="anysim-planner", daemon=True)
        worker.thread.start()
        return worker

    def _work(self, worker: _Worker) -> None:
        planner: MotionPlanner | None = None
        while True:
            with self._changed:
                while not self._queue and not self._closed and not worker.retired:
                    self._changed.wait()
                if self._closed or worker.retired:
                    return
                jobs = [f for f in self._queue.popleft() if not f.done]
                worker.jobs = jobs
                worker.give_up_at = perf_counter() + sum(f.request.deadline for f in jobs) + GRACE
            try:
                planner = self._make() if planner is None else planner
                answers = planner.plan_all([f.request for f in jobs], [f.scene for f in jobs], [f.budget for f in jobs])
                lost = False
            except BaseException as error:  # noqa: BLE001  (a stranger's code must end neither the thread nor the batch)
                lost = not isinstance(error, Exception)
                answers = [_alone(planner, f, error) if planner and len(jobs) > 1 else _failure(error) for f in jobs]
                planner = None if lost else planner
            with self._changed:
                for future, answer in zip(jobs, answers, strict=False):
                    self._answer(future, answer)
                for future in jobs:  # of which the planner has said nothing
                    self._answer(future, PlanAnswer(PlanStatus.FAILED, message="the planner gave no answer"))
                worker.jobs, worker.give_up_at = (), float("inf")
                self.counts.lost_workers += lost

    def _answer(self, future: PlanFuture, answer: PlanAnswer) -> bool:
        """Under the lock: the first answer stands."""
        if future.answer is not None:
            return False
        future.answer = answer
        self.counts.answered += 1
        self.counts.cancelled += answer.status is PlanStatus.CANCELLED
        self._changed.notify_all()
        return True

    def _give_up_the_hung(self) -> None:
        """Under the lock: answer for planners that are far beyond their deadline, and start threads in their place."""
        now = perf_counter()
        for number, worker in enumerate(self._workers):
            if now > worker.give_up_at or not worker.thread.is_alive():
                for future in worker.jobs:
                    future.budget.cancel()
                    late = PlanAnswer(PlanStatus.TIMEOUT, message="the planner did not return by its deadline")
                    self._answer(future, late)
                worker.retired = True
                self.counts.lost_workers += 1
                self._workers[number] = self._started()


def _likeness(future: PlanFuture) -> tuple[object, ...]:
    request = future.request
    return (request.joints, tuple((g.robot, g.tool, len(g.poses)) for g in request.goals), request.straight is None)


def _alone(planner: MotionPlanner, future: PlanFuture, error: BaseException) -> PlanAnswer:
    """One of a batch that broke, by itself: the one that breaks it fails alone."""
    try:
        future.budget.begin()
        return planner.plan(future.request, future.scene, future.budget)
    except BaseException as own:  # noqa: BLE001  (as above)
        return _failure(own if str(own) else error)


def _failure(error: BaseException) -> PlanAnswer:
    return PlanAnswer(PlanStatus.FAILED, message=f"the planner raised {type(error).__name__}: {error}")
