"""Pools: the envs of several services as one batch, which goes on without a service that is lost.

Env i of the batch is that of one service, in order. The pool draws the episodes of all of them, as one local env of as
many would, so results do not depend on how the envs are spread, nor on which service is lost. The envs of a lost one
fault: they fail, with a reward of NaN and observations of zero. When they are reset they get a new session, at the same
service or at another one of the pool, and the episode that they would have had.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine import arguments
from anysim.errors import AnysimError, TaskError
from anysim.math import arrays
from anysim.randomization.streams import Streams
from anysim.task.contract import FAILED, STATUS_NAMES, Obs, StepResult
from anysim.task.snapshot import EnvSnapshot
from anysim_client.env import RemoteEnv
from anysim_client.errors import ConnectionLost, ServiceError, SessionGone, TookTooLong
from anysim_client.link import Address, Link
from anysim_client.served_env import ServedEnv

_log = logging.getLogger(__name__)
LOST = (ConnectionLost, SessionGone, TookTooLong)
"""What says that a member is no more."""
_MUST_AGREE = (
    "protocol",
    "made_with",
    "task",
    "engine",
    "engine_version",
    "world_hash",
    "spec_hash",
    "observations",
    "images",
)


@dataclass
class Member:
    """A part of the batch: the envs [start, stop), and who has them; None while they are lost."""

    address: Address
    start: int
    stop: int
    env: RemoteEnv | None

    @property
    def ids(self) -> Array:
        """Its envs' numbers in the batch."""
        return np.arange(self.start, self.stop)

    def rows(self, ids: Array) -> Array:
        """Where its envs are among some of the batch, in their order."""
        return np.flatnonzero((ids >= self.start) & (ids < self.stop))


class PooledEnv(ServedEnv):
    """One batched env over many services, with the methods of an env of one service.

    Attributes:
        members: the parts of the batch.
        losses: how often a member was lost so far.
        name, num_envs, action_dim, observation_sizes, image_shapes, engine, streams: as of an env.
    """

    def __init__(self, addresses: Sequence[Address], request: Mapping[str, Any], images: str = "auto") -> None:
        """A session at each address.

        Raises:
            AnysimError: one of them refuses, or does not answer, or they differ in versions, engine, task or world.
        """
        if not addresses:
            raise TaskError("a pool needs the address of one service or more")
        self._request, self._images = dict(request), images
        self.members: list[Member] = []
        self.losses = 0
        self._spec: dict[str, Any] = {}
        try:
            for address in addresses:
                env = self._session(address, request)
                start = self.members[-1].stop if self.members else 0
                self.members.append(Member(address, start, start + env.num_envs, env))
                self._spec = self._spec or env.link.spec
                self._refuse_another(env)
        except BaseException:
            self._end()
            raise
        first = self._any()
        super().__init__(self.members[-1].stop)
        self.name, self.source, self.action_dim = first.name, first.source, first.action_dim
        self.observation_sizes, self.image_shapes = first.observation_sizes, first.image_shapes
        self.engine = first.engine._replace(num_envs=self.num_envs)
        self.action_bounds, self.action_spaces = first.action_bounds, first.action_spaces
        seed = request.get("seed")
        self.streams = Streams(self.num_envs, first.spec.seed if seed is None else seed)
        self._info = {
            "is_success": np.zeros(self.num_envs, bool),
            "fault": np.zeros(self.num_envs, bool),
            "elapsed_steps": np.zeros(self.num_envs, np.int64),
            "episode_seed": np.zeros(self.num_envs, np.uint64),
        }
        self._obs = {name: self._blank(name, self.num_envs) for name in (*self.observation_sizes, *self.image_shapes)}

    def _session(self, address: Address, request: Mapping[str, Any]) -> RemoteEnv:
        link = Link(address, dict(request))
        try:
            return RemoteEnv(link, self._images)
        except BaseException:
            link.close()
            raise

    def _any(self) -> RemoteEnv:
        for member in self.members:
            if member.env is not None:
                return member.env
        raise ConnectionLost("all services of the pool are lost")

    def _refuse_another(self, env: RemoteEnv) -> None:
        ours = self._spec
        for what in _MUST_AGREE:
            if env.link.spec[what] != ours[what]:
                raise ServiceError(
                    f"{env.link.address.address} has another {what.replace('_', ' ')} than the pool: "
                    f"{str(env.link.spec[what])[:80]} in place of {str(ours[what])[:80]}; one batch needs the same"
                )

    # ------------------------------------------------------------------ facts

    @cached_property
    def spec(self) -> Any:
        """The whole spec that the services run."""
        return self._any().spec

    @property
    def obs(self) -> Obs:
        """The latest observation of all envs; zero where a service is lost."""
        return {name: rows.copy() for name, rows in self._obs.items()}

    def details(self) -> list[dict[str, Any]]:
        """Of each env what `RemoteEnv.details` tells; nothing where a service is lost."""
        told: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for member, answer in self._each(self.members, lambda env, _: env.details()):
            told[member.start : member.stop] = answer
        return told

    # ------------------------------------------------------------------ episodes

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        mask: Array | None = None,
        episode_seeds: Sequence[int] | Array | None = None,
        overrides: Any = None,
    ) -> tuple[Obs, dict[str, Array]]:
        """Start new episodes; envs of a lost service get a new session first. As `TaskEnv.reset`.

        Raises:
            ConnectionLost: no service of the pool answers.
        """
        ids = arrays.chosen(mask, self.num_envs, TaskError)
        if seed is not None:
            self.streams.seed(seed, ids)
        given = None if episode_seeds is None else arrays.wholes("episode_seeds", episode_seeds, len(ids), TaskError)
        before = [self.streams.snapshot(np.array([i])) for i in ids.tolist()]
        self.streams.begin(ids, given)
        each = (
            dict(zip(ids.tolist(), overrides, strict=True)) if isinstance(overrides, list | tuple) and overrides else {}
        )
        concerned = self._concerned(ids)
        for member in concerned:
            if member.env is None:
                self._revive(member)

        def begin(env: RemoteEnv, member: Member) -> None:
            own = ids[member.rows(ids)]
            chosen = np.isin(member.ids, own)
            said = [each[i] for i in own.tolist()] if each else overrides
            env.reset(mask=chosen, episode_seeds=self.streams.episode_seed[own].tolist(), overrides=said)

        try:
            self._each(concerned, begin)
        except AnysimError:  # refused: the episodes were not begun
            for i, rows in zip(ids.tolist(), before, strict=True):
                self.streams.restore(np.array([i]), rows)
            raise
        for member in concerned:
            self._gather(member)
        return {name: rows[ids] for name, rows in self._obs.items()}, {k: v[ids] for k, v in self._info.items()}

    def step(self, action: Any, mask: Array | None = None) -> StepResult:
        """One control step of all envs at once, or only where `mask` (N,) is true. As `TaskEnv.step`."""
        flat = self.action_spaces.flatten(action, self.num_envs) if isinstance(action, Mapping) else np.asarray(action)
        if flat.shape != (self.num_envs, self.action_dim):
            raise TaskError(f"the action must have shape ({self.num_envs}, {self.action_dim}), got {flat.shape}")
        wanted = self._stepped(mask)
        reward = np.zeros(self.num_envs, np.float32)
        asked: list[Member] = []
        for member in self._concerned(np.flatnonzero(wanted)):
            part = wanted[member.start : member.stop]
            if member.env is None:
                raise TaskError(f"envs {member.ids[part].tolist()[:8]} were lost; call reset(mask=...) before step()")
            try:
                member.env.begin_step(flat[member.start : member.stop], None if part.all() else part)
                asked.append(member)
            except LOST as error:
                self._lose(member, error)
                reward[member.ids[part]] = np.nan
        refused: AnysimError | None = None
        for member in asked:
            try:
                assert member.env is not None
                result = member.env.end_step()
                reward[member.start : member.stop] = result.reward
                self._gather(member, result.obs)
            except LOST as error:
                self._lose(member, error)
                reward[member.ids[wanted[member.start : member.stop]]] = np.nan
            except AnysimError as error:
                refused = refused or error  # the others' answers are still to be read
        if refused is not None:
            raise refused
        return StepResult(self.obs, reward, self.status, self.info)

    def _stepped(self, mask: Array | None) -> Array:
        """The envs to step (N,) bool, by the rules of an env."""
        wanted = np.isin(np.arange(self.num_envs), arrays.chosen(mask, self.num_envs, TaskError))
        ended = wanted & ~self._running
        if not ended.any():
            return wanted
        task = self.spec.task
        if mask is None and task is not None and task.ended == "hold" and self._running.any():
            return self._running.copy()
        words = {int(i): str(STATUS_NAMES[self._code[i]]) for i in np.flatnonzero(ended)[:8]}
        raise TaskError(f"envs {words} cannot be stepped; call reset(mask=...) before step()")

    def snapshot(self, mask: Array | None = None) -> EnvSnapshot:
        """Envs at this moment, in one snapshot, as of one local env.

        Raises:
            ConnectionLost: one of them is lost.
        """
        ids = arrays.chosen(mask, self.num_envs, TaskError)
        concerned = self._concerned(ids)
        if lost := [member.address.address for member in concerned if member.env is None]:
            raise ConnectionLost(f"envs of {lost[0]} are lost; reset them first")
        parts = self._each(concerned, lambda env, member: env.snapshot(np.isin(member.ids, ids)))
        if len(parts) < len(concerned):
            raise ConnectionLost("a service was lost while its envs were put away")
        whole = EnvSnapshot.joined([part for _, part in parts])
        masters = self.streams.snapshot(ids)["masters"]  # the pool draws the episodes, not its members
        return EnvSnapshot(
            whole.engine, whole.managers, {**whole.streams, "masters": masters}, whole.task, whole.spec_hash
        )

    def reset_to(
        self, snapshot: EnvSnapshot, env_ids: Sequence[int] | Array | None = None, overrides: Any = None
    ) -> Obs:
        """Put a snapshot's envs into `env_ids` (default: all, in order); returns their observations."""
        ids = np.arange(self.num_envs) if env_ids is None else arguments.indices(env_ids, self.num_envs, "env")
        if snapshot.num_envs != len(ids):
            raise TaskError(f"the snapshot has {snapshot.num_envs} envs, and {len(ids)} are to be put back")
        each = list(overrides) if isinstance(overrides, list | tuple) and overrides else None
        concerned = self._concerned(ids)
        for member in concerned:
            if member.env is None:
                self._revive(member)

        def put(env: RemoteEnv, member: Member) -> None:
            rows = member.rows(ids)
            said = overrides if each is None else [each[row] for row in rows]
            env.reset_to(snapshot.rows(rows), ids[rows] - member.start, said)

        done = [member for member, _ in self._each(concerned, put)]
        for member in done:
            rows = member.rows(ids)
            self.streams.restore(ids[rows], snapshot.rows(rows).streams)
            self._gather(member)
        return {name: rows[ids] for name, rows in self._obs.items()}

    def render(self, camera: str | None = None, env_ids: Any = None, **options: Any) -> Array:
        """Images (E, H, W, 3) uint8 of a camera; as `TaskEnv.render`.

        Raises:
            ConnectionLost: one of the envs is lost.
        """
        ids = np.arange(self.num_envs) if env_ids is None else arguments.indices(env_ids, self.num_envs, "env")
        found: dict[int, Array] = {}

        def draw(env: RemoteEnv, member: Member) -> None:
            own = ids[member.rows(ids)]
            found.update(zip(own.tolist(), env.render(camera, own - member.start, **options), strict=True))

        self._each(self._concerned(ids), draw)
        if len(found) < len(ids):
            raise ConnectionLost("envs of a lost service cannot be drawn; reset them first")
        return np.stack([found[i] for i in ids.tolist()])

    def retire(self, env_ids: Array) -> None:
        """End episodes that are given up: these envs are truncated now if they were running."""
        ids = np.asarray(env_ids)
        concerned = self._concerned(ids)
        self._each(concerned, lambda env, m: env.retire(ids[m.rows(ids)] - m.start))
        for member in concerned:
            self._gather(member)

    # ------------------------------------------------------------------ members

    def _concerned(self, ids: Array) -> list[Member]:
        return [member for member in self.members if len(member.rows(ids))]

    def _each(self, members: Sequence[Member], do: Callable[[RemoteEnv, Member], Any]) -> list[tuple[Member, Any]]:
        """Ask several members at once, each on a thread; what those answered that were not lost."""
        from concurrent.futures import ThreadPoolExecutor

        there = [(member, member.env) for member in members if member.env is not None]
        answers: list[tuple[Member, Any]] = []
        refused: AnysimError | None = None
        if not there:
            return answers
        with ThreadPoolExecutor(len(there), "pool") as threads:
            begun = [(member, threads.submit(do, env, member)) for member, env in there]
        for member, future in begun:
            try:
                answers.append((member, future.result()))
            except LOST as error:
                self._lose(member, error)
            except AnysimError as error:
                refused = refused or error
        if refused is not None:
            raise refused
        return answers

    def _gather(self, member: Member, obs: Obs | None = None) -> None:
        """Keep what a member's envs are like now."""
        if member.env is None:
            return
        rows = slice(member.start, member.stop)
        self._code[rows], self._running[rows] = member.env.codes, member.env.running
        for name, values in member.env.info.items():
            self._info[name][rows] = values
        for name, values in (member.env.obs if obs is None else obs).items():
            self._obs[name][rows] = values

    def _lose(self, member: Member, error: Exception) -> None:
        """The service of a member is gone: its envs have faulted."""
        _log.warning("%s is lost with %d envs: %s", member.address.address, member.stop - member.start, error)
        self.losses += 1
        if member.env is not None:
            member.env.link.drop()
            member.env.close()
        member.env = None
        rows = slice(member.start, member.stop)
        self._code[rows], self._running[rows] = FAILED, False
        self._info["fault"][rows], self._info["is_success"][rows] = True, False
        for values in self._obs.values():
            values[rows] = 0

    def _revive(self, member: Member) -> None:
        """A new session for the envs of a lost one, where they were or at another service of the pool."""
        request = {**self._request, "num_envs": member.stop - member.start}
        failed: AnysimError | None = None
        own = member.address.address
        for address in sorted((m.address for m in self.members), key=lambda one: one.address != own):
            try:
                env = self._session(address, request)
            except AnysimError as error:
                failed = failed or error
                continue
            try:
                self._refuse_another(env)
            except ServiceError as error:
                env.close()
                failed = failed or error
                continue
            member.env, member.address = env, address
            return
        raise ConnectionLost(f"the envs of {own} found no service to go on at: {failed}")

    def _blank(self, name: str, count: int) -> Array:
        if name in self.observation_sizes:
            return np.zeros((count, self.observation_sizes[name]), np.float32)
        shape, kind = self._spec["images"][name]
        return np.zeros((count, *shape), kind)

    def _end(self) -> None:
        for member in self.members:
            if member.env is not None:
                member.env.close()
