"""Several tasks on one clock: each makes a control step of all its envs in its turn."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from anysim.planning.service import PlannerService
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim_collect.mixture import Limits, size_of
from anysim_collect.tally import Tally
from anysim_recording.collector import Collector, EpisodeResult


class Collection:
    """One task that is being collected.

    Attributes:
        share: of all episodes, in [0, 1].
        total: episodes that there will be; None where hours or bytes end the collection.
        tally, results: of the episodes so far.
        wall, cpu: seconds [s] that its own steps have taken, the latter of all threads of the process.
    """

    def __init__(
        self, env: TaskEnv, out: Path, episodes: int, seed: int, limits: Limits, *, share: float, total: int | None
    ) -> None:
        self.env, self.out, self.seed, self.share, self.total = env, out, seed, share, total
        self.policy, self.limits = SkillPolicy(env), limits
        self.collector = Collector(env, self.policy, out, episodes, seed, lambda: bool(limits.reached()))
        self.tally, self.results = Tally(), list[EpisodeResult]()
        self.wall = self.cpu = 0.0
        self._rounds = self.collector.rounds()

    @property
    def name(self) -> str:
        """The task and its engine."""
        return f"{self.env.name} on {self.env.engine.name}"

    @property
    def planners(self) -> tuple[PlannerService, ...]:
        """What plans its moves."""
        return self.policy.planners

    def advance(self, show: Callable[["Collection", EpisodeResult], None]) -> bool:
        """One control step of all its envs; False once it has ended. `show` gets each episode that is over by then."""
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            for result in self._rounds:
                if result is None:
                    return True
                size = 0 if result.path is None else size_of(result.path)
                self.limits.kept += size
                self.results.append(result)
                self.tally.add(result, size)
                show(self, result)
            return False
        finally:
            self.wall += time.perf_counter() - wall
            self.cpu += time.process_time() - cpu

    def close(self) -> None:
        """End it; what is unfinished is discarded."""
        self._rounds.close()


def collect(collections: Sequence[Collection], show: Callable[[Collection, EpisodeResult], None]) -> None:
    """Run all of them to their ends, a control step at a time.

    It is the turn of that which is furthest behind its share of the episodes; of several that of the one that has
    waited longest. Where the number of episodes is given all of them are run anyway, and turns just go round.
    """
    waiting = list(collections)
    while waiting:
        one = min(waiting, key=lambda c: c.tally.attempts / c.share if c.total is None else 0.0)
        waiting.remove(one)
        if one.advance(show):
            waiting.append(one)
