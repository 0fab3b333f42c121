"""Share of the engine in collecting: the processor time of its steps against that of the whole collection.

All threads count on both sides: those in which the engine steps, and the recorder's own, whose time during the engine's
steps is not the engine's.
"""

import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import NamedTuple

from anysim.engine.base import EnvIds
from anysim.record.names import EPISODES, trajectory_name
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim_recording.collector import Collector

ENGINE_SHARE_GOAL = 0.60
"""Of a collection without images in 16 envs on MuJoCo."""
_STRANGERS = 100_000
"""Envs from here on are those of the trajectories that are there before."""


class CollectCost(NamedTuple):
    """A collection.

    Attributes:
        engine: its name.
        num_envs: envs.
        episodes: episodes that were run.
        present: trajectories that were in the directory before.
        cameras: recorded cameras.
        steps: control steps of all envs together.
        steps_per_s: by the wall clock.
        cpu_s: processor time of all threads, from making the collector to its end.
        engine_s: of the engine's steps.
        record_s: of the recorder's thread.
        engine_share: engine_s of cpu_s.
        where: wall seconds by part.
    """

    engine: str
    num_envs: int
    episodes: int
    present: int
    cameras: int
    steps: int
    steps_per_s: float
    cpu_s: float
    engine_s: float
    record_s: float
    engine_share: float
    where: dict[str, float]


def collect_costs(
    engine: str,
    num_envs: int = 16,
    episodes: int = 64,
    present: int = 0,
    task: str = "pick_cube",
    cameras: bool = False,
    rounds: int = 3,
) -> list[CollectCost]:
    """Collect the same episodes `rounds` times, in one env that has been used before, each into a fresh directory."""
    from anysim.api import make

    overrides = [] if cameras else ["record.cameras=[]"]
    with (
        make(task, engine=engine, num_envs=num_envs, overrides=overrides) as env,
        tempfile.TemporaryDirectory(prefix="anysim-bench-") as folder,
    ):
        policy = SkillPolicy(env)
        warm = Path(folder) / "warm"
        results = list(Collector(env, policy, warm, num_envs, seed=1).run())
        pattern = next((result.path for result in results if result.path is not None), None)
        costs: list[CollectCost] = []
        for number in range(rounds):
            out = Path(folder) / str(number)
            if present and pattern is not None:
                _fill(out, warm, pattern, present)
            costs.append(_measured(env, policy, out, episodes, present))
    return costs


def typical(costs: list[CollectCost]) -> CollectCost:
    """The round with the median share."""
    middle = median(cost.engine_share for cost in costs)
    return min(costs, key=lambda cost: abs(cost.engine_share - middle))


def _measured(env: TaskEnv, policy: SkillPolicy, out: Path, episodes: int, present: int) -> CollectCost:
    wall, cpu = time.perf_counter(), time.process_time()
    collector = Collector(env, policy, out, episodes, seed=1)
    recording = _ThreadClock(lambda: collector.recorder.thread_ident)
    with _watched(env, recording) as spent:
        for _ in collector.run():
            recording.read()
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return CollectCost(
        env.engine.name,
        env.num_envs,
        episodes,
        present,
        len(env.spec.record.cameras),
        collector.times.steps,
        collector.times.steps / wall,
        cpu,
        spent[0],
        recording.seconds,
        spent[0] / cpu,
        collector.times.parts(),
    )


_OF_A_THREAD = 0b110
"""What marks a clock's number as that of a thread's run time; clock_getres(2) of Linux."""


class _ThreadClock:
    """Processor time of a thread that may not have begun yet, or have ended already."""

    def __init__(self, ident: Callable[[], int | None]) -> None:
        self.seconds = 0.0
        self._ident = ident

    def read(self) -> float:
        """Seconds so far."""
        ident = self._ident()
        if ident is not None:
            try:
                self.seconds = time.clock_gettime(time.pthread_getcpuclockid(ident))
            except OSError:  # it has ended
                return self.seconds
        return self.seconds


def _stepping_clock(recording: _ThreadClock) -> Callable[[], float]:
    """Reads the processor time [s] of this thread and of the engine's, which are those that there are now.

    The clock of the whole process would not do: Linux adds to it what another thread has run only when that thread is
    switched out, and an engine's threads wait awake for a moment after a step; a fifth of their time would be missed.
    """
    tasks = Path("/proc/self/task")
    if not tasks.is_dir():
        return lambda: time.process_time() - recording.read()
    clocks = [(~int(task.name) << 3) | _OF_A_THREAD for task in tasks.iterdir()]
    return lambda: sum(map(time.clock_gettime, clocks))


@contextmanager
def _watched(env: TaskEnv, recording: _ThreadClock) -> Iterator[list[float]]:
    """Adds up the processor time of the engine's steps, without that of the recorder's thread meanwhile."""
    inner, spent, clock = env.engine.step, [0.0], _stepping_clock(recording)

    def step(n_steps: int = 1, env_ids: EnvIds = None, *, keep_wrench: bool = False) -> None:
        began = clock()
        inner(n_steps, env_ids, keep_wrench=keep_wrench)
        spent[0] += clock() - began

    setattr(env.engine, "step", step)  # noqa: B010  on this object alone
    try:
        yield spent
    finally:
        delattr(env.engine, "step")


def _fill(out: Path, warm: Path, pattern: Path, count: int) -> None:
    """A run with `count` trajectories of other envs in it, all with the files of one."""
    (out / EPISODES).mkdir(parents=True)
    os.link(warm / "run.json", out / "run.json")
    names = [path.name for path in pattern.iterdir()]
    for number in range(count):
        path = out / EPISODES / trajectory_name(_STRANGERS + number % 64, number // 64)
        path.mkdir()
        for name in names:
            os.link(pattern / name, path / name)
