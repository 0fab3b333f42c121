"""Rounds of a collection: episode k of all its envs, run by a worker of an executor and handed back whole.

A worker makes the env that the command would make here, so an episode, its record and its manifest are the same bytes
wherever it is run. What is kept is written where the worker is, and goes to the run's directory through the one that
asked for it: workers need no disk in common.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir, mkdtemp
from typing import NamedTuple

from anysim.api import make
from anysim.record.incoming import FileLock, remove
from anysim.record.manifest import RunRecord, read_run
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim_collect.report import planned
from anysim_recording.collector import Collector, EpisodeResult


class Job(NamedTuple):
    """One task that workers collect; `episodes` in all, of which env i has one of every `num_envs`."""

    task: str
    engine: str
    num_envs: int
    seed: int
    episodes: int
    overrides: tuple[str, ...]
    strict_observers: bool


class EndedEpisode(NamedTuple):
    """An episode that ended, and the files of its trajectory by name; none where it is not kept."""

    result: EpisodeResult
    files: dict[str, bytes]


class Round(NamedTuple):
    """What a worker made.

    Attributes:
        run: what was run, as in run.json.
        episodes: those that ended.
        steps: control steps of all envs.
        parts: wall seconds [s] of the worker by part.
        cpu: CPU seconds [s] of the worker, without those of planners that plan in it.
        planning: what planners counted.
    """

    job: Job
    run: RunRecord
    episodes: list[EndedEpisode]
    steps: int
    parts: dict[str, float]
    cpu: float
    planning: dict[str, float]


@contextmanager
def running_rounds() -> Iterator[Callable[[Job, int, frozenset[int]], Round]]:
    """What runs a round of a job: its number, and the envs whose episode is there already. Envs are made once."""
    with ExitStack() as stack:
        made: dict[Job, tuple[TaskEnv, SkillPolicy]] = {}

        def run(job: Job, number: int, there: frozenset[int]) -> Round:
            if job not in made:
                asked = {"engine": job.engine, "num_envs": job.num_envs, "overrides": job.overrides}
                env = stack.enter_context(make(job.task, **asked, strict_observers=job.strict_observers))
                made[job] = env, SkillPolicy(env)
            return _run(job, *made[job], number, there)

        yield run


def _run(job: Job, env: TaskEnv, policy: SkillPolicy, number: int, there: frozenset[int]) -> Round:
    before, cpu, wall = planned(policy.planners), _cpu(policy), time.perf_counter()
    last = min(job.episodes, (number + 1) * env.num_envs)
    with _scratch() as out:
        wanted = lambda env, episode: episode == number and env not in there  # noqa: E731
        collector = Collector(env, policy, out, last, job.seed, wanted=wanted)
        with closing(collector.rounds()) as rounds:
            results = [result for result in rounds if result is not None]
        episodes = [EndedEpisode(replace(result, path=None), _files(result.path)) for result in results]
        return Round(
            job,
            read_run(out),
            episodes,
            collector.times.steps,
            collector.times.parts(time.perf_counter() - wall),
            _cpu(policy) - cpu,
            {name: value - before.get(name, 0.0) for name, value in planned(policy.planners).items()},
        )


def _cpu(policy: SkillPolicy) -> float:
    within = sum(service.counts.processor for service in policy.planners if not service.beside)
    return time.process_time() - within


def _files(path: Path | None) -> dict[str, bytes]:
    return {} if path is None else {file.name: file.read_bytes() for file in sorted(path.iterdir())}


@contextmanager
def _scratch() -> Iterator[Path]:
    """A directory of this machine that is gone afterwards; those of workers that were killed are removed first."""
    root = Path(gettempdir()) / f"anysim-rounds-{os.getuid()}"
    root.mkdir(mode=0o700, exist_ok=True)
    for path in root.glob("*.lock"):
        lock = FileLock.take(path)
        if lock is not None:
            remove(path.with_suffix(""))
            lock.release()
    path = Path(mkdtemp(dir=root))
    lock = FileLock.take(path.with_name(f"{path.name}.lock"), wait=True)
    assert lock is not None
    with lock:
        try:
            yield path
        finally:
            remove(path)
