"""An agent's env, and all that its session has beside it. It belongs to the thread of the session's simulator."""

import threading
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim.placement.proposals import Request
from anysim.task.bindings import bind_term
from anysim.task.env import TaskEnv
from anysim.task.snapshot import EnvSnapshot
from anysim_agents.history import History
from anysim_agents.limits import AgentLimits
from anysim_agents.live import LiveCommands
from anysim_schemas.load import LoadedRun
from anysim_schemas.proposals import Proposal

NOTHING = Proposal(poses={})


class Desk:
    """Where proposals of layouts lie until an episode begins with one.

    Attributes:
        pending: what the next episode begins with.
        request: what the last proposer was told: what there is to be placed, and where there is room.
    """

    def __init__(self) -> None:
        self.pending: Proposal = NOTHING
        self.request: Request | None = None

    def __call__(self, request: Request) -> Proposal:
        self.request = request
        return self.pending


class Moment(NamedTuple):
    """An env at a moment: its snapshot, its history, and how its arms hold what they hold."""

    snapshot: EnvSnapshot
    histories: Mapping[int, History]
    arms: Mapping[int, Sequence[dict[str, Any]]]


class AgentEnv:
    """An env, the commands that it is given, and what has happened in it.

    Attributes:
        env: of the session.
        desk: for proposals; None where the world has a source of its own.
        live: its commands.
        histories: of the present episodes, by env.
        snapshots: by the name that the agent uses.
        stop: set to have the commands under way given up.
    """

    def __init__(self, env: TaskEnv, desk: Desk | None, limits: AgentLimits) -> None:
        """The env is reset: an agent's session begins with episodes."""
        self.env, self.desk, self.limits = env, desk, limits
        self.live = LiveCommands(env)
        self.histories: dict[int, History] = {}
        self.snapshots: dict[str, Moment] = {}
        self._taken = 0
        self.stop = threading.Event()
        task = env.spec.task
        assert task is not None
        self._success = {
            name: bind_term("predicate", term, env.scene, f"task.success.{name}", env.bindings)
            for name, term in task.success.items()
        }
        self._blind: TaskEnv | None = None
        self.reset(np.arange(env.num_envs), None, {})

    def close(self) -> None:
        """Free the env."""
        if self._blind is not None:
            self._blind.close()
        self.env.close()

    # ------------------------------------------------------------------ arguments

    def number(self, env: int) -> int:
        """An env by its number.

        Raises:
            TaskError: the session has fewer.
        """
        if not 0 <= env < self.env.num_envs:
            raise TaskError(f"env: this session has envs 0 to {self.env.num_envs - 1}, got {env}")
        return env

    def numbers(self, envs: Sequence[int] | None) -> Array:
        """Envs by their numbers, all of them where none are given.

        Raises:
            TaskError: the session has fewer, or one comes twice.
        """
        if envs is None:
            return np.arange(self.env.num_envs)
        if len(set(envs)) != len(envs) or not envs:
            raise TaskError(f"envs: give each env once, and at least one, got {list(envs)}")
        return np.array(sorted(self.number(env) for env in envs))

    def mask(self, ids: Array) -> Array:
        """(N,) bool: true for these envs."""
        mask = np.zeros(self.env.num_envs, dtype=bool)
        mask[ids] = True
        return mask

    # ------------------------------------------------------------------ episodes

    def reset(self, ids: Array, seed: int | None, overrides: Mapping[str, Any], proposal: Proposal = NOTHING) -> None:
        """Begin new episodes in these envs.

        Raises:
            AnysimError: a path that cannot be overridden, or a layout that cannot be; nothing has changed then.
        """
        before = self.keep(ids) if self.histories else None
        if self.desk is not None:
            self.desk.pending = proposal
        try:
            self.env.reset(seed=seed, mask=self.mask(ids), overrides=dict(overrides))
        except BaseException:
            if before is not None:
                self.put(before, {})
            raise
        finally:
            if self.desk is not None:
                self.desk.pending = NOTHING
        self.live.begin(ids)
        for env in ids.tolist():
            self.histories[env] = History.begun(self.env, env)

    def keep(self, ids: Array) -> Moment:
        """These envs at this moment."""
        numbers = ids.tolist()
        histories = {env: self.histories[env].copy() for env in numbers}
        return Moment(self.env.snapshot(self.mask(ids)), histories, {env: self.live.kept(env) for env in numbers})

    def put(self, kept: Moment, overrides: Mapping[str, Any]) -> None:
        """Put envs back into a moment.

        Raises:
            AnysimError: a path that cannot be overridden in the middle of an episode; nothing has changed then.
        """
        ids = list(kept.histories)
        self.env.reset_to(kept.snapshot, ids, dict(overrides) or None)
        for env in ids:
            overridden = dict(self.env.streams.overridden[env])
            self.histories[env] = kept.histories[env].copy(overridden=overridden)
            self.live.put(env, kept.arms[env])

    def take(self, ids: Array) -> str:
        """Keep these envs under a new name."""
        self._taken += 1
        name = f"snapshot_{self._taken}"
        self.snapshots[name] = self.keep(ids)
        while len(self.snapshots) > self.limits.snapshots:
            del self.snapshots[next(iter(self.snapshots))]
        return name

    def taken(self, name: str) -> Moment:
        """What was kept under a name.

        Raises:
            TaskError: nothing was, or not any more.
        """
        if name not in self.snapshots:
            raise TaskError(
                f"snapshot: there is no '{name[:40]}' (there are: {listing(self.snapshots, 40)}; the "
                f"{self.limits.snapshots} last ones are kept); take one with `snapshot`"
            )
        return self.snapshots[name]

    # ------------------------------------------------------------------ looking

    def origin(self, env: int) -> Array:
        """(3,) [m] where the origin of an env's scene is."""
        return self.env.managers[0].episodes.origin[env]

    def terms(self, env: int) -> dict[str, bool]:
        """What each condition of the task's success says of an env now."""
        self.env.scene.look(np.array([env]))
        return {name: bool(term()[0]) for name, term in self._success.items()}

    def blind(self) -> tuple[TaskEnv, LoadedRun]:
        """An env of the same world that draws nothing and costs little, for words; made once."""
        from anysim.api import blind_env, load

        loaded = load(self.env.spec.to_dict() | {"num_envs": 1})
        if self._blind is None:
            self._blind = blind_env(loaded, self.env.engine.world, self.env.name)
        return self._blind, loaded
