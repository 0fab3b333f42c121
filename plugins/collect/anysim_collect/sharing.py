"""Collections that workers of an executor share: rounds are handed out, and what they kept is committed here, once."""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from anysim.api import compile_world, load
from anysim.record.commit import describe_run, disk_trouble, fsync, publish_all, write_durably
from anysim.record.incoming import Incoming, claim
from anysim.record.manifest import RunRecord
from anysim.record.names import EPISODES, parse_trajectory, run_name, trajectories, trajectory_name
from anysim_collect.endings import Ran
from anysim_collect.mixture import Limits, size_of
from anysim_collect.report import mixed, report_of, write_report
from anysim_collect.rounds import EndedEpisode, Job, Round, running_rounds
from anysim_collect.tally import Tally
from anysim_processes.executors import share
from anysim_recording.collector import EpisodeResult, resumed

Show = Callable[[str, EpisodeResult], None]
"""Called with the task once an episode has ended, and is on the disk where it is kept."""


class Keeper:
    """Keeps what workers made in a run's directory: trajectories that become visible whole, as a recorder's do."""

    def __init__(self, out: Path) -> None:
        """Claim the directory.

        Raises:
            RecordError: another process records there, or it cannot be written.
        """
        self._out, self._run = out, None
        try:
            with ExitStack() as undo:
                undo.enter_context(claim(out))
                self._incoming = Incoming(out)
                undo.callback(self._incoming.close)
                self._close = undo.pop_all().close
        except OSError as error:
            raise disk_trouble(f"cannot record into {out}", error, out) from error

    def close(self) -> None:
        """Leave the directory to others."""
        self._close()

    def keep(self, run: RunRecord, episodes: Sequence[EndedEpisode]) -> list[Path | None]:
        """Commit episodes of a run; where each of them is, None for those that are not kept.

        Raises:
            RecordError: the directory has another run, as one of other versions, or the disk is full.
        """
        try:
            if run != self._run:
                with self._incoming.startup():
                    describe_run(self._out, self._incoming.path, run)
                self._run: RunRecord | None = run
            return self._commit(episodes)
        except OSError as error:
            raise disk_trouble(f"cannot commit into {self._out}", error, self._out) from error

    def _commit(self, episodes: Sequence[EndedEpisode]) -> list[Path | None]:
        folder = self._out / EPISODES
        if not folder.exists():
            folder.mkdir()
            fsync(self._out)
        moves: list[tuple[Path, Path]] = []
        paths: list[Path | None] = []
        for result, files in episodes:
            final = folder / trajectory_name(result.env, result.episode)
            paths.append(final if files else None)
            if files:
                aside = self._incoming.attempt(result.env, result.episode)
                for name, data in files.items():
                    write_durably(aside / name, data)
                moves.append((aside, final))
        for error in publish_all(moves):
            if error is not None:
                raise error
        return paths


class SharedCollection:
    """One task that workers collect.

    Attributes:
        total: episodes that there will be; None where hours or bytes end the collection.
        tally, results: of the episodes so far.
        steps, cpu, parts, planning: of all workers, as in `Round`.
        name, engine_version: of the task and the engine; the argument and an empty word while no round is over.
    """

    def __init__(self, job: Job, out: Path, share: float, total: int | None) -> None:
        self.job, self.out, self.share, self.total, self.name = job, out, share, total, job.task
        self.tally, self.results = Tally(), list[EpisodeResult]()
        self.steps, self.cpu, self.engine_version = 0, 0.0, ""
        self.parts, self.planning = dict[str, float](), dict[str, float]()
        self.keeper = Keeper(out)
        self.there = {ids for path in trajectories(out) if (ids := parse_trajectory(path.name)) is not None}
        self.handed_out = 0

    def rounds(self) -> Iterator[tuple[Job, int, frozenset[int]]]:
        """The rounds of which something is to be run; what is there already is counted on the way."""
        envs = self.job.num_envs
        for number in range(-(-self.job.episodes // envs)):
            own = range(min(envs, self.job.episodes - number * envs))
            there = frozenset(env for env in own if (env, number) in self.there)
            for env in sorted(there):
                self.count(resumed(self.out, env, number))
            self.handed_out += len(own)
            if len(there) < len(own):
                yield self.job, number, there

    def add(self, made: Round) -> list[EpisodeResult]:
        """Keep what a worker made; the episodes, each with its path."""
        found: list[EpisodeResult] = []
        paths = self.keeper.keep(made.run, made.episodes)
        for (result, _), path in zip(made.episodes, paths, strict=True):
            found.append(EpisodeResult(**{**vars(result), "path": path}))
            self.count(found[-1])
        self.steps, self.cpu = self.steps + made.steps, self.cpu + made.cpu
        self.name, self.engine_version = made.run.task, f"{made.run.engine} {made.run.engine_version}"
        for total, more in ((self.parts, made.parts), (self.planning, made.planning)):
            for name, value in more.items():
                total[name] = total.get(name, 0.0) + value
        return found

    def count(self, result: EpisodeResult) -> None:
        """Count an episode."""
        self.results.append(result)
        self.tally.add(result, 0 if result.path is None else size_of(result.path))


def shared_job(
    task: str, engine: str | None, num_envs: int | None, seed: int | None, overrides: Sequence[str]
) -> tuple[Job, Path]:
    """What workers are told of a task, without its episodes; and where it is recorded if nothing else is said.

    Raises:
        SpecError: the file of the task is wrong, with the place.
    """
    more = [*overrides, *([] if num_envs is None else [f"num_envs={num_envs}"])]
    loaded = load(task, overrides=more)
    if engine is not None and loaded.spec.engine.name != engine:
        loaded = load(task, overrides=[*more, f"engine={json.dumps(engine)}"])
    spec = loaded.spec.without_curricula()
    named = task if "/" not in task else compile_world(loaded).name
    chosen = spec.seed if seed is None else seed
    out = Path("runs") / run_name(named, spec.engine.name, spec.to_dict(), chosen)
    return Job(task, spec.engine.name, spec.num_envs, chosen, 0, tuple(overrides), False), out


def collect_shared(
    collections: Sequence[SharedCollection], limits: Limits, executor: str, workers: int | None, show: Show
) -> float:
    """Run all of them to their ends by workers of an executor; the wall seconds [s] that it took.

    A round is handed out of that which is furthest behind its share of the episodes. Once a limit is reached no more
    are; those that are under way are run to their ends.
    """
    began, by_job = time.perf_counter(), {one.job: one for one in collections}

    def work() -> Iterator[tuple[Job, int, frozenset[int]]]:
        waiting = {one.job: one.rounds() for one in collections}
        while waiting and not limits.reached():
            job = min(waiting, key=lambda job: by_job[job].handed_out / by_job[job].share)
            item = next(waiting[job], None)
            if item is None:
                del waiting[job]
            else:
                yield item

    for made in share(executor, work(), running_rounds, workers):
        one = by_job[made.job]
        for result in one.add(made):
            limits.kept += 0 if result.path is None else size_of(result.path)
            show(one.job.task, result)
    return time.perf_counter() - began


def ended(collections: Sequence[SharedCollection], balance: str, wall: float, reached: str) -> list[Ran]:
    """Write the reports of collections that have ended.

    Args:
        collections: of all tasks.
        balance: what their shares are to balance.
        wall: seconds [s] that all of it took; the parts of it are those of the workers' time.
        reached: the limit that ended it, in words.
    """
    whole = sum(sum(one.parts.values()) for one in collections)
    reports = [_report(one, wall / whole if whole else 0.0) for one in collections]
    mixture = mixed(reports, [one.share for one in collections], balance)
    found: list[Ran] = []
    for one, report in zip(collections, reports, strict=True):
        page = write_report(one.out, report | {"mixture": mixture})
        results = sorted(one.results, key=lambda r: (r.env, r.episode))
        found.append(Ran(one.out, results, one.tally, one.steps, report["wall_s"], reached, page, mixture))
    return found


def _report(one: SharedCollection, scale: float) -> dict[str, Any]:
    job = one.job
    what = {
        "task": one.name,
        "engine": job.engine,
        "engine_version": one.engine_version,
        "num_envs": job.num_envs,
        "seed": job.seed,
    }
    parts = {name: seconds * scale for name, seconds in one.parts.items()}
    return report_of(what, one.tally, parts, one.cpu) | {"planning": one.planning}
