"""Workspace of a server: the sessions of its agents, and the commands that are under way in them."""

import asyncio
import json
import secrets
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any

from anysim.engine.capability import Capability
from anysim.engine.factory import engine_class
from anysim.errors import listing
from anysim.task.env import TaskEnv
from anysim_agents import commanding
from anysim_agents.agent_env import AgentEnv, Desk
from anysim_agents.commanding import Run
from anysim_agents.limits import AGENT, AgentLimits
from anysim_client.errors import SessionGone, SessionTaken
from anysim_schemas.collect import CollectSpec
from anysim_schemas.load import LoadedRun
from anysim_serving.catalogue import Catalogue, SessionRequest
from anysim_serving.sessions import Session, Sessions

Told = Callable[[float, str], Awaitable[None]]
"""Is told how far a command is: control steps so far, and words."""
VIEW = "world.cameras.view"
"""The camera that a session has whose world has none, so that its agent can look around."""
SWEEP_S = 1.0


@dataclass
class Entry:
    """A session as its agent has it.

    Attributes:
        handle: the word that its agent uses.
        run: the commands that were given last.
        going: the task that makes control steps of them.
    """

    handle: str
    session: Session
    run: Run | None = None
    going: "asyncio.Task[dict[str, Any]] | None" = None
    progress: dict[str, Any] | None = None


class Workspace:
    """What one server holds. Its methods belong to the event loop's thread."""

    def __init__(self, catalogue: Catalogue, limits: AgentLimits = AGENT, *, shared: bool = True) -> None:
        """`shared` says whether several clients may reach the server: sessions then have names that nobody guesses."""
        self.catalogue, self.limits, self._shared = catalogue, limits, shared
        self.sessions = Sessions(catalogue, catalogue.limits)
        self.entries: dict[str, Entry] = {}
        self._count = 0
        self._giving_up: asyncio.Task[Any] | None = None
        self._one = asyncio.Lock()

    # ------------------------------------------------------------------ sessions

    async def create(self, request: SessionRequest) -> Entry:
        """A session of a task that is served, with its episodes begun.

        Raises:
            AnysimError: it is not served, cannot be built, or there are too many.
        """
        count = await asyncio.to_thread(self._checked, request)
        name = self.catalogue.name(request)

        def build() -> AgentEnv:
            loaded = self.catalogue.loaded(request)
            desk = Desk() if loaded.spec.world.layout_source is None else None
            more = _view(loaded, request.engine or self.catalogue.engine)
            env = self.catalogue.build(request, more, desk)
            return _agent_env(env, desk, self.limits)

        return await self._admit(name, count, build)

    async def create_world(self, loaded: LoadedRun, num_envs: int, seed: int | None) -> Entry:
        """A session of a world that was read from an agent's text.

        Raises:
            AnysimError: it cannot be built, or there are too many.
        """
        from anysim.api import make

        def build() -> AgentEnv:
            desk = Desk() if loaded.spec.world.layout_source is None else None
            env = make(loaded, num_envs=num_envs, seed=seed, overrides=_view(loaded, None), proposals=desk)
            return _agent_env(env, desk, self.limits)

        return await self._admit(loaded.spec.world.name, num_envs, build)

    def _checked(self, request: SessionRequest) -> int:
        self.catalogue.checked(request)
        return self.catalogue.envs(request)

    async def _admit(self, name: str, count: int, build: Callable[[], AgentEnv]) -> Entry:
        session = await self.sessions.admit(name, count, build)
        self.sessions.attach(session)  # an agent may think for as long as `idle_s`
        self._count += 1
        handle = f"s{self._count}" + (f"_{secrets.token_urlsafe(12)}" if self._shared else "")
        self.entries[handle] = entry = Entry(handle, session)
        return entry

    def entry(self, handle: str) -> Entry:
        """The session that a word stands for.

        Raises:
            SessionGone: none does, or it has ended.
        """
        entry = self.entries.get(handle)
        if entry is None or entry.session.id not in self.sessions.open:
            self.entries.pop(handle, None)
            known = "" if self._shared else f" (there are: {listing(self._alive())})"
            raise SessionGone(
                f"session: there is no '{handle[:40]}'{known}; it has ended, after {self.sessions.limits.idle_s:g} s "
                f"without a call, or never was: call create_session"
            )
        return entry

    def _alive(self) -> list[str]:
        return [name for name, entry in self.entries.items() if entry.session.id in self.sessions.open]

    def visible(self) -> list[Entry]:
        """The sessions that any client may be told of: none where each has its own."""
        return [] if self._shared else [self.entries[name] for name in self._alive()]

    async def end(self, entry: Entry) -> None:
        """End a session; commands under way are given up."""
        await self.cancel(entry)
        self.entries.pop(entry.handle, None)
        self.sessions.end(entry.session, "by_client")

    async def keep_clean(self) -> None:
        """End what has been idle for too long, until it is cancelled."""
        while True:
            await asyncio.sleep(SWEEP_S)
            self.sessions.sweep()
            for handle in set(self.entries) - set(self._alive()):
                del self.entries[handle]

    async def close(self) -> None:
        """End all sessions, and wait until their envs are freed."""
        for entry in list(self.entries.values()):
            await self.cancel(entry)
        self.entries.clear()
        await self.sessions.close(lambda words: None)

    # ------------------------------------------------------------------ operations

    async def apart(self, work: Callable[[], Any]) -> Any:
        """What takes a while and needs no session, on a thread: one at a time, whichever session asks."""
        async with self._one:
            return await asyncio.to_thread(work)

    async def do(self, entry: Entry, job: Callable[[AgentEnv], Any], *, changes: bool = False) -> Any:
        """Have a session's thread do something; what `changes` the env is refused while commands are under way.

        Raises:
            SessionTaken: commands are under way.
            AnysimError: what the job says.
        """
        if changes:
            self.refuse_busy(entry)
        return await self.sessions.do(entry.session, job)

    def refuse_busy(self, entry: Entry) -> None:
        """Refuse what must not happen while commands are under way.

        Raises:
            SessionTaken: they are.
        """
        if entry.going is not None and not entry.going.done():
            at = "" if entry.progress is None else f" ({json.dumps(entry.progress['at'])})"
            words = "" if entry.run is None else f"'{entry.run.words}' "
            raise SessionTaken(
                f"{words}is under way in this session{at}: wait for it (`status` tells how it goes on), or `cancel` it"
            )

    async def command(
        self, entry: Entry, commands: CollectSpec, envs: Sequence[int] | None, wait: float, told: Told | None
    ) -> dict[str, Any]:
        """Give commands to envs, and wait for them.

        Args:
            entry: the session.
            commands: what is to be done.
            envs: where; everywhere if None.
            wait: seconds after which they go on without this call.
            told: is told of progress.

        A call that is cancelled gives the commands up.

        Returns:
            How they ended, or how far they are.
        """
        self.refuse_busy(entry)
        entry.progress = None
        entry.going = asyncio.create_task(self._carry_out(entry, commands, envs, told))
        entry.going.add_done_callback(_seen)
        try:
            done, _ = await asyncio.wait({entry.going}, timeout=min(wait, self.limits.wait_s))
        except asyncio.CancelledError:  # its client has cancelled the call, or is gone
            self._giving_up = asyncio.create_task(self.cancel(entry))
            raise
        if done:
            return entry.going.result()
        return {"done": False, "progress": entry.progress, "next": "call `status` for the end of it, or `cancel`"}

    async def _carry_out(
        self, entry: Entry, commands: CollectSpec, envs: Sequence[int] | None, told: Told | None
    ) -> dict[str, Any]:
        entry.run = None
        entry.run = run = await self.do(entry, lambda agent: commanding.begin(agent, commands, agent.numbers(envs)))
        while not run.over:
            entry.progress = now = await self.do(entry, lambda agent: commanding.go_on(agent, run))
            if told is not None:
                try:
                    await told(float(now["steps"]), "; ".join(f"env {i}: {at}" for i, at in now["at"].items()))
                except Exception:  # noqa: BLE001 - who asked may be gone; the commands go on
                    told = None
        return outcome(run)

    async def cancel(self, entry: Entry) -> dict[str, Any] | None:
        """Give up the commands under way, and say how far they were; None where there are none."""
        if entry.going is None or entry.going.done():
            return None
        while entry.run is None and not entry.going.done():
            await asyncio.sleep(0.005)  # they are about to begin
        if not entry.going.done():
            await self.do(entry, lambda agent: agent.stop.set())
        await asyncio.wait({entry.going})
        return None if entry.run is None else outcome(entry.run)

    def about(self, entry: Entry) -> dict[str, Any]:
        """What is known of a session without its thread."""
        said = entry.session.about()
        told: dict[str, Any] = {"session": entry.handle, "task": said["task"], "num_envs": said["num_envs"]}
        told |= {"age_s": round(said["age_s"], 1), "ends_after_idle_s": self.sessions.limits.idle_s}
        if entry.going is not None and not entry.going.done():
            told["commands"] = {"done": False, "progress": entry.progress}
        elif entry.going is not None and entry.going.exception() is not None:
            told["commands"] = {"done": True, "error": str(entry.going.exception())}
        elif entry.run is not None:
            told["commands"] = outcome(entry.run)
        return told


def _seen(task: "asyncio.Task[Any]") -> None:
    """What a task raised was looked at; `status` tells it."""
    if not task.cancelled():
        task.exception()


def outcome(run: Run) -> dict[str, Any]:
    """How commands ended."""
    ends = [run.ended[i] for i in sorted(run.ended)]
    return {"done": run.over, "ok": all(end["ok"] for end in ends), "commands": run.words, "envs": ends}


def _agent_env(env: TaskEnv, desk: Desk | None, limits: AgentLimits) -> AgentEnv:
    try:
        return AgentEnv(env, desk, limits)
    except BaseException:
        env.close()
        raise


def _view(loaded: LoadedRun, engine: str | None) -> list[str]:
    """Overrides that give a world without a camera one, where the engine can draw."""
    draws = Capability.RENDER_RGB in engine_class(engine or loaded.spec.engine.name).capabilities
    if loaded.spec.world.cameras or not draws:
        return []
    camera = {"from": [1.0, -1.0, 1.0], "look_at": [0.0, 0.0, 0.2], "size": [320, 240]}
    return [f"{VIEW}={json.dumps(camera)}"]
