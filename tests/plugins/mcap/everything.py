"""A run with every stream: a ball rolls before two cameras, sensed, seen, labelled and spoken of."""

from pathlib import Path
from typing import Any

import numpy as np

import anysim
from anysim.task.env import TaskEnv
from anysim_recording.collector import Collector, EpisodeResult

WORLD = Path(__file__).with_name("everything.yaml")


class Still:
    """A policy without actions."""

    name = "still"

    def __init__(self, env: TaskEnv) -> None:
        self._env = env

    def begin(self, env_ids: Any) -> None:
        pass

    def act(self, env_ids: Any) -> Any:
        return np.zeros((self._env.num_envs, 0))

    def gave_up(self, env_ids: Any) -> Any:
        return np.zeros(len(env_ids), bool)

    def solved(self, env_ids: Any) -> Any:
        return np.zeros(len(env_ids), bool)

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        return {}


def made(*overrides: str) -> TaskEnv:
    """Two envs."""
    return anysim.make(WORLD, num_envs=2, overrides=overrides)


def collect(env: TaskEnv, out: Path, episodes: int = 2) -> list[EpisodeResult]:
    """Collect in them."""
    return list(Collector(env, Still(env), out, episodes, seed=1).run())


def collected(out: Path, *overrides: str, episodes: int = 2) -> list[EpisodeResult]:
    """The same in envs of their own."""
    with made(*overrides) as env:
        return collect(env, out, episodes)


if __name__ == "__main__":
    import sys
    import time

    from anysim.record.reader import open_trajectory
    from anysim_inspect.verify import verify_run

    began = time.perf_counter()
    found = collected(Path(sys.argv[1]))
    print(time.perf_counter() - began, verify_run(sys.argv[1]))
    reader = open_trajectory(found[0].path or "")
    for name in reader.names():
        rows = reader.stream(name)
        print(
            name, len(rows.steps), getattr(rows.values, "dtype", type(rows.values)), getattr(rows.values, "shape", "")
        )
