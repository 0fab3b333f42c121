"""The planner service `processes`: planners in processes of their own, which take no time from the control loop's.

Each process is started as a program, holds one planner of the World that it was sent once, and dies with its parent.
Messages go over a socket pair that no other process can reach.
"""

import contextlib
import os
import signal
import sys
from time import perf_counter

from anysim.errors import AnysimError
from anysim.model.world import World
from anysim.planning.motion import PlanAnswer, PlanStatus
from anysim.planning.service import PlanFuture
from anysim_planning.answering import PlannerMaker, planner_maker
from anysim_planning.planner_process import NOTES
from anysim_planning.queued import GRACE, QueuedService, Seat, overdue
from anysim_processes.shared_memory import SharedArrays
from anysim_processes.worker_handle import THREAD_POOLS, Worker, WorkerLost

GLANCE = 0.05
"""[s] between looks at whether a process hangs."""
IDLE = 0.5
"""[s] between looks at whether a process that has nothing to do is still there."""
MESSAGE_LIMIT = 60.0
"""[s] in which a process takes a message; it may have to start first."""


class ProcessService(QueuedService):
    """Worker processes around planners; one that hangs or dies is replaced, and the request that it had fails."""

    beside = True

    def __init__(self, world: World, planner: str | PlannerMaker = "rrt", workers: int = 1) -> None:
        """`planner`: a name, or what makes one, which processes import; each makes its own.

        Raises:
            AnysimError: fewer workers than one, a maker that cannot be imported elsewhere, or a system without POSIX.
            PluginError: there is no planner of that name.
        """
        planner_maker(world, planner)
        if sys.platform == "win32":
            raise AnysimError("planners in processes need a POSIX system; use the service 'threads' on Windows")
        path = planner if isinstance(planner, str) else f"{planner.__module__}:{getattr(planner, '__qualname__', '<>')}"
        if "<" in path or path.startswith("__main__:"):
            raise AnysimError(
                f"the maker of planners {planner!r} cannot be imported by other processes; name a class or a function "
                f"at the top of a module, or use the service 'threads'"
            )
        self._world, self._path = world, path
        self._processes: dict[Seat, PlannerProcess] = {}  # a thread adds and takes away its own
        super().__init__(workers)

    @property
    def pids(self) -> tuple[int, ...]:
        """Ids of the processes that are there."""
        with self._changed:
            return tuple(process.pid for process in self._processes.values())

    def _work(self, seat: Seat) -> None:
        try:
            self._start(seat)
            while (jobs := self._next(seat, IDLE)) is not None:
                process = self._processes.get(seat)
                if jobs:
                    self._plan(seat)
                elif process is not None and process.useful and process.has_news(0.0):  # it can only have ended
                    self._lose(seat)
                    self._start(seat)
        finally:
            self._drop(seat)

    def _plan(self, seat: Seat) -> None:
        """Answer the requests of a seat; where it is not known which one its process was lost with, each goes alone."""
        alone = False
        while seat.jobs and not self._closed:
            batch = list[PlanFuture]()
            try:
                process = self._open(seat)
                with self._changed:
                    seat.jobs = [future for future in seat.jobs if not future.done]
                    batch = seat.jobs[: 1 if alone else None]
                    process.note(batch)
                if batch:
                    process.ask()
                for _ in batch:
                    self._give(seat, *self._answer_of(process, seat))
            except Exception as how:  # noqa: BLE001  (`WorkerLost`, or a request that cannot be sent)
                left = [future for future in batch if future in seat.jobs] or seat.jobs
                begun = [future for future in left if future.budget.end < float("inf")]
                self._lose(seat)
                if len(begun) != 1 and not alone:
                    alone = True
                    continue
                blamed = (begun or left)[0]
                with self._changed:
                    seat.jobs.remove(blamed)
                    self._answer(blamed, overdue() if isinstance(how, _Overdue) else _failed(how))
                if not self._closed:
                    self._start(seat)

    def _answer_of(self, process: "PlannerProcess", seat: Seat) -> tuple[PlanAnswer, float]:
        """The next answer, and its processor time [s]; raises `WorkerLost` where there is none in time."""
        patience = GRACE
        while not process.has_news(GLANCE):
            process.tell_ends()
            patience -= GLANCE * self._closed
            if seat.hangs or patience <= 0:
                raise _Overdue
        process.tell_ends()
        return process.answer()

    def _stop(self, seat: Seat, future: PlanFuture) -> None:
        if seat in self._processes:
            self._processes[seat].give_up(future)

    # ------------------------------------------------------------------ processes

    def _open(self, seat: Seat) -> "PlannerProcess":
        """The process of a seat, started where there is none; raises `WorkerLost` where that fails."""
        if seat not in self._processes:
            process = PlannerProcess()
            with self._changed:
                self._processes[seat] = process
                if self._closed:
                    process.stop()
            try:
                process.introduce(self._world, self._path)
            except BaseException:
                self._drop(seat, 0.0)
                raise
        return self._processes[seat]

    def _ending(self) -> None:
        """Nobody waits for a process that is still being loaded, and takes no message before it is."""
        for process in self._processes.values():
            if not process.useful:
                process.stop()

    def _start(self, seat: Seat) -> None:
        """Start its process before there is anything to do; where that fails, the first request is told."""
        with contextlib.suppress(Exception):
            self._open(seat)

    def _lose(self, seat: Seat) -> None:
        with self._changed:
            self.counts.lost_workers += 1
        self._drop(seat, 0.0)

    def _drop(self, seat: Seat, patience: float = GRACE) -> None:
        with self._changed:
            process = self._processes.pop(seat, None)
        if process is not None:
            process.end(patience)


class PlannerProcess:
    """The parent's side of one process, for one thread.

    Attributes:
        pid: the process id.
        useful: whether it has answered anything.
    """

    def __init__(self) -> None:
        """Start it; raises `WorkerLost` if that fails."""
        self.useful, self._batch, self._notes = False, list[PlanFuture](), SharedArrays(NOTES)
        environment = {**os.environ, **dict.fromkeys(THREAD_POOLS, "1")}
        try:
            self._worker = Worker(environment, MESSAGE_LIMIT, "anysim_planning.planner_process")
        except OSError as error:
            self._notes.close()
            raise WorkerLost(f"could not be started: {error}") from None
        self.pid, self.has_news = self._worker.pid, self._worker.has_news

    def introduce(self, world: World, planner: str) -> None:
        """Send the World and the planner's name, or `module:maker`; raises `WorkerLost` if it has ended."""
        self._worker.post((world, planner), self._notes.descriptor)

    def stop(self) -> None:
        """Kill it at once, from any thread; its own thread then loses it."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def note(self, batch: list[PlanFuture]) -> None:
        """Take requests that are asked next."""
        self._batch = batch
        self._notes["given_up"][:] = False
        self._notes["end"][:] = float("inf")
        self.tell_ends()

    def give_up(self, future: PlanFuture) -> None:
        """Ask it to stop with a request."""
        if future in self._batch:
            self._notes["given_up"][self._batch.index(future)] = True

    def ask(self) -> None:
        """Send the requests."""
        self._worker.post(("plan", [(future.request, future.scene) for future in self._batch]))

    def tell_ends(self) -> None:
        """Tell the requests' budgets here when their time is over there."""
        for future, end in zip(self._batch, self._notes["end"], strict=False):
            future.budget.end = float(end)

    def answer(self) -> tuple[PlanAnswer, float]:
        """The next answer, which is on its way, and its processor time [s]."""
        found = self._worker.answer(perf_counter() + MESSAGE_LIMIT, MESSAGE_LIMIT)
        self.useful = True
        return found

    def end(self, patience: float) -> None:
        """End it, killing it where it does not by itself within `patience` [s]."""
        try:
            if patience:
                self._worker.part()
                self._worker.close(patience)
        finally:
            self._worker.kill()
            self._notes.close()


class _Overdue(WorkerLost):
    """A process that is beyond a deadline."""


def _failed(how: Exception) -> PlanAnswer:
    said = str(how) if isinstance(how, WorkerLost) else f"cannot be asked: {type(how).__name__}: {how}"
    return PlanAnswer(PlanStatus.FAILED, message=f"the planner's process {said}")
