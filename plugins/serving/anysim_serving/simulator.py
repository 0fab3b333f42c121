"""Simulators of a service: an env, the one thread that builds, steps and frees it, and a bounded queue."""

import logging
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol

from anysim_client.errors import ServiceBusy, SessionGone

_log = logging.getLogger(__name__)
Job = Callable[[Any], Any]
"""Something to do with what a simulator has built."""


class Simulated(Protocol):
    """An env, or what holds one."""

    def close(self) -> None: ...


class Simulator:
    """An env on a thread of its own. Engines keep state by thread, and no two clients may step one at a time.

    Attributes:
        since: when the operation at hand began [s, perf_counter], 0 while there is none.
        busy_s: seconds that operations took so far.
    """

    def __init__(self, name: str, build: Callable[[], Simulated], waiting: int) -> None:
        self._jobs: queue.Queue[tuple[Job, Future[Any]] | None] = queue.Queue(waiting)
        self._build, self._ended = build, threading.Event()
        self.since = self.busy_s = 0.0
        self.built: Future[Simulated] = Future()
        self._thread = threading.Thread(target=self._run, name=f"simulator {name}", daemon=True)
        self._thread.start()

    @property
    def depth(self) -> int:
        """Operations that wait."""
        return self._jobs.qsize()

    @property
    def ended(self) -> bool:
        """Whether it takes no more operations."""
        return self._ended.is_set()

    def submit(self, job: Job) -> "Future[Any]":
        """Have the thread do something with the env.

        Raises:
            ServiceBusy: as many wait as may.
            SessionGone: it has ended.
        """
        if self._ended.is_set():
            raise SessionGone("the session has ended; create another")
        future: Future[Any] = Future()
        try:
            self._jobs.put_nowait((job, future))
        except queue.Full:
            raise ServiceBusy(f"{self._jobs.maxsize} operations wait for this simulator; ask again later") from None
        return future

    def end(self) -> None:
        """Let it finish the operation at hand and free the env; those that wait are refused. May be called twice."""
        if self._ended.is_set():
            return
        self._ended.set()
        self._refuse_waiting()
        self._jobs.put(None)  # room was just made, and nothing is taken any more

    def join(self, timeout: float) -> bool:
        """Wait for its end; whether that came in time."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _refuse_waiting(self) -> None:
        while True:
            try:
                waiting = self._jobs.get_nowait()
            except queue.Empty:
                return
            if waiting is not None:
                waiting[1].set_exception(SessionGone("the session ended before this operation began"))

    def _run(self) -> None:
        self.since = time.perf_counter()
        try:
            env = self._build()
        except BaseException as error:  # noqa: BLE001 - it is the answer to who asked for it
            self._ended.set()
            self.built.set_exception(error)
            return
        finally:
            self.since = 0.0
        try:
            self.built.set_result(env)
            self._serve(env)
        finally:
            self._ended.set()
            self._refuse_waiting()
            try:
                env.close()
            except Exception:  # noqa: BLE001 - whatever it is, the thread ends
                _log.exception("an env could not be closed")

    def _serve(self, env: Simulated) -> None:
        while (waiting := self._jobs.get()) is not None:
            job, future = waiting
            if not future.set_running_or_notify_cancel():
                continue
            self.since = time.perf_counter()
            try:
                result = job(env)
            except BaseException as error:  # noqa: BLE001 - it is the answer to who asked for it
                future.set_exception(error)
            else:
                future.set_result(result)
                del result
            finally:
                self.busy_s += time.perf_counter() - self.since
                self.since = 0.0
            del job, future, waiting
