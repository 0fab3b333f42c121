"""Cost of anysim on top of an engine: both loops in one run, interleaved, the best of several rounds of each."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import cycle
from math import inf
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.control import Control, alternating
from anysim.errors import EngineError, TaskError
from anysim.model.world import Actuation
from anysim.task.env import TaskEnv

BOXES = 5
CHUNK_STEPS = 4000
"""Physics steps of one timed chunk over all envs together, at least ten control steps."""

FEWEST_ROUNDS = 3
"""Rounds that are measured however long they take."""


class StepCost(NamedTuple):
    """Physics steps per second of all envs together, for one number of envs.

    Attributes:
        engine: its name.
        what: `engine` (control write, step, state read) or `env` (a whole task step).
        actuation: who computes the drives; the raw loop always has the engine's own.
        num_envs: envs.
        ours: through anysim [steps/s, wall].
        raw: the engine's own loop [steps/s, wall].
        ratio: ours / raw, of wall time.
        cpu_ratio: the same of processor time, which other load on the machine disturbs less.
        budget: the least `ratio` that is good enough; None where there is no budget.
    """

    engine: str
    what: str
    actuation: str
    num_envs: int
    ours: float
    raw: float
    ratio: float
    cpu_ratio: float
    budget: float | None

    @property
    def missed(self) -> bool:
        """Whether the ratio is below its budget."""
        return self.budget is not None and self.ratio < self.budget


class _Floor(NamedTuple):
    engine: str
    what: str
    ratio: float
    fewest: int
    most: int
    actuation: Actuation | None = None


_BUDGET_TASK = "pick_cube"
_ANY = 1 << 30
_FLOORS = (
    _Floor("mujoco", "engine", 0.90, 1, 1),
    _Floor("pybullet", "engine", 0.88, 1, 1, Actuation.NATIVE),
    _Floor("sapien", "engine", 0.85, 1, 1, Actuation.NATIVE),
    _Floor("sapien", "engine", 0.92, 16, 64, Actuation.IMPLICIT_PD),
    _Floor("mujoco", "env", 0.82, 16, 16),
    _Floor("pybullet", "env", 0.88, 16, 16),
    _Floor("sapien", "env", 0.82, 16, 16),
    _Floor("", "engine", 0.65, 1, 15),
    _Floor("", "engine", 0.90, 16, _ANY),
)
"""The first that fits is the budget; those without a name are for any engine's loop, also a stranger's."""


def budget(engine: str, what: str, actuation: str, num_envs: int) -> float | None:
    """The least ratio to the raw loop that is good enough; None where there is no budget."""
    fits = (
        floor.ratio
        for floor in _FLOORS
        if floor.engine in ("", engine)
        and floor.what == what
        and floor.fewest <= num_envs <= floor.most
        and floor.actuation in (None, actuation)
    )
    return next(fits, None)


def panda_and_boxes() -> dict[str, Any]:
    """The world of the step benchmark: a Panda and five boxes on the ground."""
    boxes = {f"box{i}": {"source": {"box": [0.06, 0.06, 0.06]}, "density": 500.0} for i in range(BOXES)}
    layout = {f"box{i}": {"on": "terrain", "x": 0.45, "y": -0.3 + 0.15 * i} for i in range(BOXES)}
    return {
        "world": {
            "name": "panda_and_boxes",
            "robots": {"panda": {"robot": "franka_panda"}},
            "objects": boxes,
            "layout": layout,
        }
    }


def engines_with_raw_loop() -> list[str]:
    """The installed engines that can run here and have a loop of their own to compare with."""
    from anysim.engine.base import SimEngine
    from anysim.engine.factory import engine_class, runnable

    return [name for name in runnable() if engine_class(name).raw_loop is not SimEngine.raw_loop]


def engines_of(words: str) -> list[str]:
    """The engines of a list with commas; `all` are those with a raw loop."""
    return engines_with_raw_loop() if words == "all" else [name.strip() for name in words.split(",")]


def engine_cost(
    engine_name: str,
    num_envs: int,
    rounds: int = 7,
    actuation: Actuation = Actuation.IMPLICIT_PD,
    seconds: float = inf,
    world_file: str = "",
) -> StepCost:
    """Stepping through SimEngine, writing commands and reading the state every control step, against the raw loop.

    The world is that of a file, or a Panda with five boxes, to which alone budgets belong. After `seconds` no further
    round begins, once `FEWEST_ROUNDS` are done.

    Raises:
        EngineError: the engine offers no raw loop.
    """
    from anysim.api import compile_world
    from anysim.engine.factory import create_simulation

    world = compile_world(world_file or panda_and_boxes())
    world = replace(world, physics=replace(world.physics, actuation=actuation))
    with create_simulation(engine_name) as engine:
        engine.create_world(world, num_envs)
        substeps = world.physics.substeps
        engine.step(100)
        cost = _compare("engine", control_loop(engine, substeps), engine, rounds, seconds)
        return cost._replace(budget=None) if world_file else cost


def control_loop(engine: SimEngine, substeps: int) -> Callable[[], None]:
    """One control step: commands in, other ones than before, physics, joints and bodies out."""
    turns = cycle([control.position for control in alternating(engine.control)])

    def step() -> None:
        engine.set_control(position=next(turns))
        engine.step(substeps)
        state = engine.get_state()
        _ = state.joint_pos, state.joint_vel, state.body_pose, state.body_twist

    return step


def env_cost(
    engine_name: str, num_envs: int, task: str = _BUDGET_TASK, rounds: int = 7, seconds: float = inf
) -> StepCost:
    """A whole task step (action, physics, status, reward, observation) against the raw loop of its world.

    Actions are in turn those for the two commands that the raw loop writes; where a controller takes no joint
    positions, its action is zero.
    """
    from anysim.api import make

    with make(task, engine=engine_name, num_envs=num_envs, overrides=["task.horizon=1000000000"]) as env:
        env.reset(seed=0)
        still = np.zeros((num_envs, env.action_dim))
        for _ in range(20):
            env.step(still)
        actions: list[Array] = []
        for control in alternating(env.engine.control)[::-1]:  # deltas: each action is for where the last one led
            actions.append(_action_for(env, control))
            env.step(actions[-1])
        turns = cycle(actions)
        cost = _compare("env", lambda: env.step(next(turns)), env.engine, rounds, seconds)
        return cost if task == _BUDGET_TASK else cost._replace(budget=None)


def _action_for(env: TaskEnv, control: Control) -> Array:
    action, ids = np.zeros((env.num_envs, env.action_dim)), np.arange(env.num_envs)
    for part in env.actions.slices:
        targets = control.position[:, part.controller.channel.columns]
        try:
            action[:, part.start : part.stop] = part.controller.action_for(targets, ids)
        except TaskError:
            continue
    return action


def _compare(what: str, ours: Callable[[], Any], engine: SimEngine, rounds: int, seconds: float) -> StepCost:
    num_envs, substeps, raw_loop = engine.num_envs, engine.world.physics.substeps, engine.raw_loop()
    if raw_loop is None:
        raise EngineError(f"engine '{engine.name}' offers no raw loop to compare with")
    calls = max(10, CHUNK_STEPS // (num_envs * substeps))
    best: dict[str, Sequence[float]] = {}
    begin = time.perf_counter()
    for number in range(rounds):
        if number >= FEWEST_ROUNDS and time.perf_counter() - begin > seconds:
            break
        for name, call in (("ours", ours), ("raw", lambda: raw_loop(substeps))):
            wall, cpu = time.perf_counter(), time.process_time()
            for _ in range(calls):
                call()
            spent = (time.perf_counter() - wall, time.process_time() - cpu)
            best[name] = tuple(map(min, spent, best.get(name, spent)))
    steps = calls * substeps * num_envs
    actuation = str(engine.world.physics.actuation)
    (our_wall, our_cpu), (raw_wall, raw_cpu) = best["ours"], best["raw"]
    return StepCost(
        engine.name,
        what,
        actuation,
        num_envs,
        steps / our_wall,
        steps / raw_wall,
        raw_wall / our_wall,
        raw_cpu / our_cpu,
        budget(engine.name, what, actuation, num_envs),
    )
