"""Clocks of a collection, that run while their part of it is at work. No result depends on them."""

import time
from typing import Self

from anysim.task.env import TaskEnv


class Stopwatch:
    """Seconds spent inside its `with` blocks by the wall clock, without what was drawn in them."""

    def __init__(self, env: TaskEnv) -> None:
        self.seconds = 0.0
        self._env = env
        self._began = 0.0

    def __enter__(self) -> Self:
        self._began = time.perf_counter() - drawn(self._env)
        return self

    def __exit__(self, *_: object) -> None:
        self.seconds += time.perf_counter() - drawn(self._env) - self._began


class CollectTimes:
    """The clocks of a collection.

    Attributes:
        steps: control steps, of all envs together.
        env: in `TaskEnv.step`, physics included.
        reset: in `TaskEnv.reset`.
        policy: what decides on actions.
        record: filling columns, handing episodes over, and waiting for the recorder's thread.
    """

    def __init__(self, env: TaskEnv) -> None:
        self.steps = 0
        self.env, self.reset, self.policy, self.record = (Stopwatch(env) for _ in range(4))
        self._env = env
        self._began, self._physics, self._drawn = time.perf_counter(), env.physics_seconds, drawn(env)

    def parts(self, whole: float | None = None) -> dict[str, float]:
        """Wall seconds by part; they add up to `whole`, which is since the collector was made unless it is given."""
        physics = self._env.physics_seconds - self._physics
        parts = {
            "physics": physics,
            "terms": self.env.seconds - physics,
            "resets": self.reset.seconds,
            "policy": self.policy.seconds,
            "record": self.record.seconds,
            "draw": drawn(self._env) - self._drawn,
        }
        whole = time.perf_counter() - self._began if whole is None else whole
        return parts | {"other": whole - sum(parts.values())}


def drawn(env: TaskEnv) -> float:
    """Seconds that an env's images have taken so far."""
    return 0.0 if env.capture is None else env.capture.draw_seconds
