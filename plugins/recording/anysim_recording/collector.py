"""The collector: one clock, many timelines. Each env runs its own episodes; what succeeds is kept.

Env i runs episodes 0, 1, 2… of its own stream, as many as its share; so which episodes are run, and how they come out,
does not depend on how fast the others are or how many there are.
"""

import sys
import weakref
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.commit import disk_trouble
from anysim.record.film import camera_of, draw_recorded, film_mode
from anysim.record.frame import NOTHING, FrameBatch, state_batch
from anysim.record.header import EpisodeHeader, RunHeader, package_versions, state_layout
from anysim.record.incoming import claim
from anysim.record.manifest import read_manifest
from anysim.record.names import EPISODES, trajectory_name
from anysim.record.streams import make_sources
from anysim.record.writer import make_writer
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim_recording.collect_times import CollectTimes
from anysim_recording.recorder import Recorder
from anysim_recording.trajectory_files import PendingCommit

STATE_FIELDS = ("joint_pos", "joint_vel", "body_pose", "body_twist", "control_position")
"""What is recorded of the state in each step."""
RERUNS = 3
"""How often an episode is begun anew whose worker process is lost, before it is given up."""


class Policy(Protocol):
    """What drives the envs: `anysim.skills.runner.SkillPolicy`, or anything with the same methods."""

    name: str

    def begin(self, env_ids: Array) -> None:
        """These envs have just been reset."""
        ...

    def act(self, env_ids: Array) -> Array:
        """Actions (N, A); rows other than `env_ids` are ignored."""
        ...

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: it is of no use to go on in these envs."""
        ...

    def solved(self, env_ids: Array) -> Array:
        """(n,) bool: all that was to be done is done and the task's success holds, though the episode may go on."""
        ...

    def describe(self, env: int) -> dict[str, Any]:
        """Plain data about what an env is doing."""
        ...

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """Plain data about an episode that has ended; under `segments` the parts of it that hold by themselves."""
        ...


@dataclass(frozen=True)
class EpisodeResult:
    """How an episode came out.

    `path` is its trajectory if one was kept; `resumed` says it was there already. `reruns` is how often it was begun
    anew because its worker process was lost; `lost` that it was so each time: it did not fail, it was never run.
    `fault` says why the simulation ended it, as of a body that left the world; empty where nothing did.
    """

    env: int
    episode: int
    episode_seed: int
    status: str
    steps: int
    total_reward: float
    outcome: dict[str, Any]
    path: Path | None = None
    resumed: bool = False
    reruns: int = 0
    lost: bool = False
    fault: str = ""

    @property
    def success(self) -> bool:
        """Whether the task was solved."""
        return self.status == Status.SUCCESS


def resumed(out: Path, env: int, episode: int) -> EpisodeResult:
    """How an episode came out whose trajectory is in `out`."""
    path = out / EPISODES / trajectory_name(env, episode)
    m = read_manifest(path)
    outcome = dict(m.outcome)
    reward = float(outcome.pop("total_reward", 0.0))
    return EpisodeResult(env, episode, m.episode_seed, m.status, m.steps, reward, outcome, path, resumed=True)


def run_header(env: TaskEnv, seed: int) -> RunHeader:
    """What all trajectories of a run of this env have in common."""
    action = list(env.action_spaces.labels)
    example = {group: np.zeros(size, np.float32) for group, size in env.observation_sizes.items()}
    world = env.engine.world
    return RunHeader(
        task=env.name,
        seed=seed,
        engine=env.engine.name,
        engine_version=env.engine.version,
        world_hash=world.hash,
        control_dt=world.physics.control_dt,
        layout=state_layout(world, STATE_FIELDS, action, example, env.sensor_rows(np.arange(1))),
        spec=env.spec.to_dict(),
        packages=package_versions(),
        notes=tuple(f"{thing}: {note}" for thing, note in world.notes),
    )


class Collector:
    """Runs episodes and records them. Use it once: `for result in collector.run(): ...`."""

    def __init__(
        self,
        env: TaskEnv,
        policy: Policy,
        out: Path,
        episodes: int,
        seed: int,
        enough: Callable[[], bool] | None = None,
        wanted: Callable[[int, int], bool] = lambda env, episode: True,
    ) -> None:
        """Run `episodes` in all, shared out as evenly as can be: env i runs one of every N, where it is `wanted`.

        Once `enough` says so no episode is begun any more; those that are under way are run to their ends.
        """
        self.env, self.policy, self.seed = env, policy, seed
        self._enough, self._wanted = enough, wanted
        record, task = env.spec.record, env.spec.task
        assert task is not None
        self._film = film_mode(env.spec)
        writer = make_writer(record.writer, record.options)
        try:
            lock = claim(out)  # before a second run of the same command spends its time on the same episodes
        except OSError as error:
            raise disk_trouble(f"cannot record into {out}", error, out) from error
        self._release = weakref.finalize(self, lock.release)
        try:
            header, sources = run_header(env, seed), make_sources(env)
            self.recorder = Recorder(out, writer, header, horizon=task.horizon, sources=sources)
        except BaseException:
            self._release()
            raise
        self.times = CollectTimes(env)
        self._capture, self._instructions = env.capture, [task.description] * env.num_envs
        self._share = np.array([len(range(i, episodes, env.num_envs)) for i in range(env.num_envs)])
        self._episode = np.full(env.num_envs, -1)
        self._total = np.zeros(env.num_envs)
        self._reruns = np.zeros(env.num_envs, dtype=int)
        self._again: dict[int, int] = {}
        """The seeds of episodes that are to be begun anew, by env."""
        self._pending: deque[tuple[EpisodeResult, PendingCommit]] = deque()

    def run(self) -> Iterator[EpisodeResult]:
        """Run all episodes.

        Yields each that an earlier run has committed, and each other one when it has ended and, where it is kept, when
        its trajectory is on the disk.
        """
        with closing(self.rounds()) as rounds:
            yield from (result for result in rounds if result is not None)

    def rounds(self) -> Generator[EpisodeResult | None]:
        """The same, and None after each control step of the envs: between two of them other work may be done."""
        env, times = self.env, self.times
        try:
            env.streams.seed(self.seed, np.arange(env.num_envs))
            yield from self._start(np.arange(env.num_envs))
            while (active := env.running).any():
                ids = np.flatnonzero(active)
                with times.policy:
                    action = self.policy.act(ids)
                with times.env:
                    result = env.step(action, None if active.all() else active)
                times.steps += len(ids)
                self._append(ids, result.reward, result.status)
                running, solved = result.status[ids] == Status.RUNNING, self.policy.solved(ids)
                over = ids[~running | solved | self.policy.gave_up(ids)]
                solved = set(ids[running & solved].tolist())
                for i in over.tolist():
                    yield from self._finish(i, str(Status.SUCCESS if i in solved else result.status[i]))
                yield from self._settled()
                yield from self._start(over)
                yield None
            with times.record:
                self.recorder.flush()
            yield from self._settled()
        finally:
            with times.record:
                self._close()

    def _close(self) -> None:
        failing = sys.exc_info()[0] is not None
        try:
            self.recorder.close()
        except RecordError:
            if not failing:  # else it is the error that ends the run that is told
                raise
        finally:
            self._release()

    # ------------------------------------------------------------------ the beginning and end of an episode

    def _start(self, ids: Array) -> Iterator[EpisodeResult]:
        """Begin the next episode of these envs, passing over what is committed already."""
        if len(ids) == 0:
            return
        begin = np.zeros(self.env.num_envs, dtype=bool)
        again = np.array([int(i) in self._again for i in ids])
        begin[ids[again]] = True
        for i in map(int, ids[~again]):
            self._episode[i] += 1
            self._reruns[i] = 0
            while (k := int(self._episode[i])) < self._share[i] and (
                (there := self.recorder.is_committed(i, k)) or not self._wanted(i, k)
            ):
                self.env.streams.skip(i, 1)
                if there:
                    yield resumed(self.recorder.out, i, k)
                self._episode[i] += 1
            begin[i] = self._episode[i] < self._share[i] and not (self._enough is not None and self._enough())
        self.env.retire(ids[~begin[ids]])
        if not begin.any():
            return
        fresh = np.flatnonzero(begin)
        with self.times.reset:
            self._reset(begin, ids[again])
        seen = self.env.engine.appearance_changes
        with self.times.policy:
            self.policy.begin(fresh)
        self._total[fresh] = 0.0
        with self.times.record:
            for i in map(int, fresh):
                later = partial(draw_recorded, self.env, i, int(seen[i])) if self._film == "success" else None
                self._instructions[i] = self.env.instruction(i)
                self.recorder.start(self._header(i), later)
        self._append(fresh, None, self.env.status)

    def _reset(self, begin: Array, again: Array) -> None:
        """Reset the envs of a mask; those `again` to the episode that they had."""
        repeated = np.zeros(self.env.num_envs, dtype=bool)
        repeated[again] = True
        if (new := begin & ~repeated).any():
            self.env.reset(mask=new)
        if len(again):
            seeds = [self._again.pop(int(i)) for i in np.flatnonzero(repeated)]
            self.env.reset(mask=repeated, episode_seeds=seeds)

    def _header(self, i: int) -> EpisodeHeader:
        env = self.env
        return EpisodeHeader(
            env=i,
            episode=int(self._episode[i]),
            episode_seed=int(env.streams.episode_seed[i]),
            drawn=env.streams.draws[i],
            overridden=env.streams.overridden[i],
            instruction=self._instructions[i],
            cameras={name: camera_of(env, i, name) for name in env.spec.record.cameras},
        )

    def _finish(self, i: int, status: str) -> Iterator[EpisodeResult]:
        """Commit or discard an episode; yields it at once where it is not kept, and not if it is to be run again."""
        env = self.env
        lost = bool(env.info["fault"][i] and env.engine.lost[i])
        if lost and self._reruns[i] < RERUNS:
            self._reruns[i] += 1
            self._again[i] = int(env.streams.episode_seed[i])
            env.retire(np.array([i]))
            self.recorder.discard(i)
            return
        steps, total = int(env.scene.elapsed[i]), float(self._total[i])
        outcome = self.policy.ended(i, status == Status.SUCCESS)
        if status == Status.RUNNING:  # the policy gave up
            status = str(Status.FAILED)
        kept = env.spec.record.keep
        keep = kept == "all" or status == Status.SUCCESS or (kept == "segments" and bool(outcome.get("segments")))
        seed = int(env.streams.episode_seed[i])
        result = EpisodeResult(
            i, int(self._episode[i]), seed, status, steps, total, outcome, reruns=int(self._reruns[i]), lost=lost
        )
        if env.info["fault"][i] and not lost:
            result = replace(result, fault=env.engine.fault_reason(i))
        if keep and not env.info["fault"][i]:
            with self.times.record:
                self._pending.append((result, self.recorder.commit(i, status, outcome | {"total_reward": total})))
        else:
            self.recorder.discard(i)
            yield result

    def _settled(self) -> Iterator[EpisodeResult]:
        """The episodes whose trajectories are on the disk by now, oldest first.

        Every committed episode passes here once: whatever is to be done with its files can begin here.
        """
        while self._pending and self._pending[0][1].done:
            result, pending = self._pending.popleft()
            yield replace(result, path=pending.wait())

    # ------------------------------------------------------------------ frames

    def _append(self, ids: Array, reward: Array | None, status: Array) -> None:
        """Record one frame of each env; filmed live, with images of the cameras that are due.

        A faulted env has no frame.
        """
        env, times = self.env, self.times
        ids = ids[~env.info["fault"][ids]]
        if len(ids) == 0:
            return
        images: Sequence[Mapping[str, Array]] = [NOTHING] * len(ids)
        if env.spec.record.cameras and self._film == "live":
            with times.record:
                images = self._images(ids)
        with times.record:
            state, numbers = env.engine.get_state(), ids.tolist()
            rows = None if len(ids) == env.num_envs else ids
            gained = np.zeros(len(ids)) if reward is None else reward[ids].astype(float)
            self._total[ids] += gained
            self.recorder.append_batch(
                numbers,
                FrameBatch(
                    step=env.scene.elapsed[ids].tolist(),
                    time=state.time[ids],
                    action=env.scene.last_action[ids],
                    state=state_batch(state, STATE_FIELDS, env.engine.control, rows) | env.sensor_rows(ids),
                    reward=gained,
                    status=status[ids].tolist(),
                    obs={group: values[ids] for group, values in env.obs.items() if not group.startswith("images/")},
                    annotations=[self.policy.describe(i) for i in numbers],
                    language=[self._instructions[i] for i in numbers],
                    images=images,
                ),
            )

    def _images(self, ids: Array) -> list[dict[str, Array]]:
        """The images of each of these envs by camera, of those that are due."""
        due = self._capture.due(ids)
        images: dict[int, dict[str, Array]] = {i: {} for i in ids.tolist()}
        for camera in self.env.spec.record.cameras if len(due) else ():
            for i, picture in zip(due.tolist(), self._capture.picture(camera, due), strict=True):
                images[i][camera] = picture
        return list(images.values())
