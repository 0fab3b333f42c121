"""Sessions: who has which simulator, for how long, and what is counted of it."""

import asyncio
import hmac
import logging
import secrets
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from anysim_client.errors import LimitExceeded, SessionGone, SessionTaken, TookTooLong
from anysim_serving.catalogue import Catalogue, SessionRequest
from anysim_serving.operations import handshake
from anysim_serving.settings import Limits
from anysim_serving.simulator import Job, Simulated, Simulator

_log = logging.getLogger(__name__)
_UNTIL_FREED_S = 30.0
"""How long the end of a service waits for an operation at hand."""


@dataclass
class Session:
    """A simulator that belongs to the client who created it: `key` is known to that client alone.

    Attributes:
        ready: whether it is built; how long that may take is limited elsewhere.
        attached: whether a connection has it now.
        last: of the greatest number of a message so far; each must be greater.
        counts: operations, errors, steps (of one env each) and bytes.
    """

    id: str
    key: str
    task: str
    num_envs: int
    simulator: Simulator
    spec: dict[str, Any] = field(default_factory=dict)
    ready: bool = False
    attached: bool = False
    last: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    created: float = field(default_factory=time.monotonic)
    used: float = field(default_factory=time.monotonic)
    over: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when it has ended."""

    def about(self) -> dict[str, Any]:
        """What everyone with the token may see of it."""
        now = time.monotonic()
        return {
            "id": self.id,
            "task": self.task,
            "num_envs": self.num_envs,
            "attached": self.attached,
            "waiting": self.simulator.depth,
            "age_s": round(now - self.created, 3),
            "idle_s": round(now - self.used, 3),
            "counts": dict(self.counts),
        }


class Sessions:
    """All sessions of a service. Its methods belong to the event loop's thread."""

    def __init__(self, catalogue: Catalogue, limits: Limits) -> None:
        self.catalogue, self.limits = catalogue, limits
        self.open: dict[str, Session] = {}
        self.total: Counter[str] = Counter()
        """Of the counts of sessions that have ended, and of why they have."""
        self._ending: set[Simulator] = set()

    async def create(self, request: SessionRequest) -> Session:
        """Build a simulator for a client.

        Raises:
            LimitExceeded: there are as many sessions or envs as may be.
            AnysimError: what is asked for is not served, or cannot be built.
        """
        count = await asyncio.to_thread(self._checked, request)
        session = await self.admit(self.catalogue.name(request), count, lambda: self.catalogue.build(request))
        try:
            session.spec = await self.do(session, lambda env: handshake(env, session.task))
        except BaseException:
            self.end(session, "failed")
            raise
        return session

    async def admit(self, name: str, count: int, build: Callable[[], Simulated]) -> Session:
        """A session of what `build` makes, with `count` envs, on the thread which then steps it.

        Raises:
            LimitExceeded: there are as many sessions or envs as may be.
            AnysimError: it cannot be built.
        """
        if count > self.limits.envs:
            raise LimitExceeded(f"a session has at most {self.limits.envs} envs, asked for {count}")
        while self._ending and len(self.open) + len(self._ending) >= self.limits.sessions:
            ends = next(iter(self._ending))  # memory that is being freed may be had again
            await asyncio.to_thread(ends.join, _UNTIL_FREED_S)
            self._ending.discard(ends)
        self._refuse_more(count)
        ident = secrets.token_hex(8)
        simulator = Simulator(ident, build, self.limits.waiting)
        session = Session(ident, secrets.token_urlsafe(24), name, count, simulator)
        self.open[ident] = session
        try:
            await asyncio.wait_for(asyncio.wrap_future(simulator.built), self.limits.op_s)
        except BaseException as error:
            self.end(session, "failed")
            if isinstance(error, TimeoutError):
                raise TookTooLong(f"building took longer than {self.limits.op_s:g} s") from None
            raise
        self.total["created"] += 1
        session.ready, session.used = True, time.monotonic()
        return session

    def _checked(self, request: SessionRequest) -> int:
        self.catalogue.checked(request)
        return self.catalogue.envs(request)

    def _refuse_more(self, count: int) -> None:
        if len(self.open) >= self.limits.sessions:
            raise LimitExceeded(f"there are {self.limits.sessions} sessions, which is the most; end one, or wait")
        taken = sum(session.num_envs for session in self.open.values())
        if taken + count > self.limits.total_envs:
            raise LimitExceeded(
                f"{taken} of {self.limits.total_envs} envs are taken, {count} more are too many; ask for fewer, or wait"
            )

    def owned(self, ident: str, key: str) -> Session:
        """The session of a client that knows its key.

        Raises:
            SessionGone: there is none, or it is another's: which of the two is not told.
        """
        session = self.open.get(ident)
        right = hmac.compare_digest(key.encode(), (session.key if session else "-").encode())
        if session is None or not right:
            raise SessionGone("there is no such session under this key; it has ended, or never was: create another")
        return session

    def attach(self, session: Session) -> None:
        """Give a session to a connection.

        Raises:
            SessionTaken: another connection has it.
        """
        if session.attached:
            raise SessionTaken("another connection has this session; one client steps a simulator at a time")
        session.attached, session.last = True, 0
        session.used = time.monotonic()

    def detach(self, session: Session) -> None:
        """The connection is gone; with the key it can be taken up again for a while."""
        session.attached, session.used = False, time.monotonic()

    def submit(self, session: Session, job: Job) -> "Future[Any]":
        """Have a simulator do something.

        Raises:
            ServiceBusy, SessionGone: it cannot now, or not any more.
        """
        session.used = time.monotonic()
        return session.simulator.submit(job)

    async def do(self, session: Session, job: Job) -> Any:
        """Have a simulator do something, and wait for it."""
        return await self.result(session, self.submit(session, job))

    async def result(self, session: Session, future: "Future[Any]") -> Any:
        """What an operation gave.

        Raises:
            TookTooLong: it goes on beyond its time; the session is ended.
        """
        try:
            async with asyncio.timeout(self.limits.op_s):
                return await asyncio.wrap_future(future)
        except TimeoutError:
            self.end(session, "too_long")
            raise TookTooLong(f"an operation took longer than {self.limits.op_s:g} s; the session has ended") from None
        finally:
            session.used = time.monotonic()

    def end(self, session: Session, why: str) -> None:
        """End a session: the operation at hand finishes, and then its env is freed. May be called twice."""
        if self.open.pop(session.id, None) is None:
            return
        self.total.update(session.counts)
        self.total[f"ended_{why}"] += 1
        session.over.set()
        session.simulator.end()
        self._ending.add(session.simulator)
        _log.info("session %s ended: %s", session.id, why)

    def sweep(self) -> None:
        """End what has been idle or alive for too long, or whose simulator has died; called now and then."""
        now, limits = time.monotonic(), self.limits
        for session in list(self.open.values()):
            idle = now - session.used
            if not session.ready:
                continue
            if session.simulator.ended:
                self.end(session, "died")
            elif now - session.created > limits.lifetime_s:
                self.end(session, "lifetime")
            elif session.simulator.since or session.simulator.depth:
                continue
            elif idle > (limits.idle_s if session.attached else min(limits.linger_s, limits.idle_s)):
                self.end(session, "idle")
        self._ending = {simulator for simulator in self._ending if not simulator.join(0.0)}

    async def close(self, told: Callable[[str], object]) -> None:
        """End all sessions, and wait until their envs are freed."""
        for session in list(self.open.values()):
            self.end(session, "closed")
        for simulator in list(self._ending):
            if not await asyncio.to_thread(simulator.join, _UNTIL_FREED_S):
                told("an operation is still going on and is given up")
        self._ending.clear()
