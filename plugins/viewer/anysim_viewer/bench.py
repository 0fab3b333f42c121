"""The cost of a view to the loop that it looks at."""

import subprocess
import sys
import time
from collections.abc import Mapping
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from anysim.api import make
from anysim.errors import AnysimError
from anysim.task.env import TaskEnv
from anysim_viewer.view import RATE
from anysim_viewer.watch import RunView

SLOWEST = 600.0
"""[s] after which the client of a measurement ends by itself."""


class Cost(NamedTuple):
    """Processor time of control steps of all envs [us], medians over the rounds.

    Attributes:
        loop: `fast`, one step after the other, or `paced`, as many as time passes.
        engine, num_envs: of what.
        alone, viewed: of the stepping thread.
        moments: that were handed over, for each step.
        process_alone, process_viewed: of all threads of the process.
    """

    loop: str
    engine: str
    num_envs: int
    alone: float
    viewed: float
    moments: float
    process_alone: float
    process_viewed: float

    @property
    def moment(self) -> float:
        """Of the stepping thread for each moment [us]: how often moments come depends on what else a machine does."""
        return (self.viewed - self.alone) / self.moments

    @property
    def share(self) -> float:
        """Of a core's time that moments take the stepping thread, at the most that are sent a second."""
        return RATE * self.moment / 1e6


class Run(NamedTuple):
    """One measurement: processor time of the thread and of the process [us] for each step."""

    thread: float
    process: float


def cost(task: str | Mapping[str, Any], engine: str | None, num_envs: int, steps: int, rounds: int) -> list[Cost]:
    """Measure both loops, with a view and without in turn, so that what else the machine does hits both alike."""
    with make(task, engine=engine, num_envs=num_envs) as env:
        env.reset(seed=0)
        _steps(env, 10, paced=False)
        found = [_cost(env, loop, steps, rounds) for loop in ("fast", "paced")]
    return found


def _cost(env: TaskEnv, loop: str, steps: int, rounds: int) -> Cost:
    paced = loop == "paced"
    alone: list[Run] = []
    viewed: list[Run] = []
    moments: list[float] = []
    for _ in range(rounds):
        alone.append(_steps(env, steps, paced))
        with RunView(env, port=0) as view:
            client = subprocess.Popen(
                [sys.executable, "-m", "anysim_viewer.client", view.url, str(SLOWEST)],
                stdout=subprocess.PIPE,
                text=True,
            )
            try:
                _await(view)
                before = view.handed
                viewed.append(_steps(env, steps, paced))
                moments.append((view.handed - before) / steps)
            finally:
                client.terminate()
                client.communicate()
    return Cost(
        loop,
        env.engine.name,
        env.num_envs,
        median(run.thread for run in alone),
        median(run.thread for run in viewed),
        median(moments),
        median(run.process for run in alone),
        median(run.process for run in viewed),
    )


def _await(view: RunView) -> None:
    """Wait until the client looks."""
    end = time.monotonic() + 60.0
    while not view.watched:
        if time.monotonic() > end:
            raise AnysimError("the client of the measurement did not come within a minute")
        time.sleep(0.05)
    time.sleep(0.5)  # what it is sent at first belongs to no step


def _steps(env: TaskEnv, steps: int, paced: bool) -> Run:
    still = np.tile(np.clip(np.zeros(env.action_dim), *env.action_bounds), (env.num_envs, 1))
    thread = process = 0
    due = time.monotonic()
    for _ in range(steps):
        if not env.running.all():
            env.reset(mask=~env.running)
        before = time.thread_time_ns(), time.process_time_ns()
        env.step(still)
        thread += time.thread_time_ns() - before[0]
        process += time.process_time_ns() - before[1]
        if paced:
            due += env.engine.world.physics.control_dt
            time.sleep(max(0.0, due - time.monotonic()))
    return Run(thread / steps / 1e3, process / steps / 1e3)
