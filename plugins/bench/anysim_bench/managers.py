"""Cost of managers, terms and streams: their share of a control step, and milliseconds of a reset.

Both are timed from within: a clock runs for what is at work, each manager, the task's terms, or the engine below
them, and stops while something it called is at work. So reading a state or writing a friction is the engine's time,
under the manager that asked for it, and all else is what managers, terms and streams cost. The best of many rounds of
each clock counts; the share is a ratio of two clocks of one run.
"""

import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from anysim.task.env import TaskEnv

STEP_BUDGET = 0.10
"""Of a control step, for managers, terms and streams together."""
RESET_BUDGET_MS = 2.0
"""For each env of a reset, without the engine."""
_ENGINE = (
    "step", "reset", "get_state", "_read_locked", "set_joint_state", "set_body_state", "set_control",
    "set_parameters", "set_camera_pose", "apply_wrench", "get_parameters",
)  # fmt: skip
_TERMS = ("reset", "observe", "judge", "reward", "interval_events")
_TASK, _REST = "task", "streams and bookkeeping"


class Cost(NamedTuple):
    """What a part costs: of a control step [ms] of all envs, or of a full reset [ms] for each env.

    Attributes:
        engine: its name.
        num_envs: envs.
        part: a manager, the task, streams and bookkeeping, or `all`.
        own_ms: its own time.
        engine_ms: that of the engine at its calls.
        share: own_ms of the whole, theirs and the engine's.
    """

    engine: str
    num_envs: int
    part: str
    own_ms: float
    engine_ms: float
    share: float


class Clock:
    """Time by part, exclusive: while a call that is measured too is at work, its caller's clock stands still."""

    def __init__(self) -> None:
        self.spent: dict[tuple[str, bool], float] = defaultdict(float)
        """Seconds by part and by whether it was the engine."""
        self._stack: list[tuple[str, bool]] = [(_REST, False)]
        self._since = time.perf_counter()

    def _turn(self) -> None:
        now = time.perf_counter()
        self.spent[self._stack[-1]] += now - self._since
        self._since = now

    def start(self) -> None:
        """From here on."""
        self.spent.clear()
        self._since = time.perf_counter()

    def stop(self) -> dict[tuple[str, bool], float]:
        """Up to here."""
        self._turn()
        return dict(self.spent)

    def watch(self, owner: Any, method: str, part: str | None) -> Callable[[], None]:
        """Measure a method of one object, as the engine's where `part` is None; call what it returns to leave off."""
        inner, stack = getattr(owner, method), self._stack

        def timed(*arguments: Any, **keywords: Any) -> Any:
            if part is None and stack[-1][1]:  # an engine's method that calls another of its own
                return inner(*arguments, **keywords)
            self._turn()
            stack.append((stack[-1][0], True) if part is None else (part, False))
            try:
                return inner(*arguments, **keywords)
            finally:
                self._turn()
                stack.pop()

        setattr(owner, method, timed)
        return lambda: delattr(owner, method)


def task_env(engine: str, num_envs: int, task: str) -> TaskEnv:
    """The env that is measured: the task without images, whose episodes do not end."""
    from anysim.api import load, make

    loaded = load(task)
    blind = [f"world.cameras.{name}.channels=[]" for name in loaded.spec.world.cameras]
    more = [*blind, "record.cameras=[]", "task.horizon=1000000000"]
    return make(task, engine=engine, num_envs=num_envs, overrides=more)


def step_costs(env: TaskEnv, rounds: int = 200) -> list[Cost]:
    """Times of each part of a control step of all envs [ms]; the last row is the sum."""
    env.reset(seed=0)
    action = np.zeros((env.num_envs, env.action_dim))
    return _costs(env, lambda: env.step(action), rounds, 1.0)


def reset_costs(env: TaskEnv, rounds: int = 30) -> list[Cost]:
    """Times of each part of a full reset, for each env [ms]; the last row is the sum."""
    env.reset(seed=0)
    return _costs(env, env.reset, rounds, 1.0 / env.num_envs)


def _costs(env: TaskEnv, call: Callable[[], Any], rounds: int, scale: float) -> list[Cost]:
    clock = Clock()
    undo = [clock.watch(env.engine, method, None) for method in _ENGINE]
    for manager in env.managers:
        undo.append(clock.watch(manager, "reset", manager.name))
    undo += [clock.watch(env.actions, method, env.actions.name) for method in ("validated", "act", "update")]
    undo += [clock.watch(env.mdp, method, _TASK) for method in _TERMS]
    best: dict[tuple[str, bool], float] = {}
    try:
        for _ in range(3):  # kernels are compiled, caches are warm
            call()
        for _ in range(rounds):
            clock.start()
            call()
            spent = clock.stop()
            best = {key: min(time_s, best.get(key, time_s)) for key, time_s in spent.items()}
    finally:
        for leave in undo:
            leave()
    whole = sum(best.values())
    parts = dict.fromkeys(part for part, _ in best)
    table = {part: (best.get((part, False), 0.0), best.get((part, True), 0.0)) for part in parts}
    table["all"] = (sum(own for own, _ in table.values()), sum(engine for _, engine in table.values()))
    return [
        Cost(env.engine.name, env.num_envs, part, own * scale * 1e3, engine * scale * 1e3, own / whole)
        for part, (own, engine) in table.items()
    ]
