"""How much anysim costs on top of an engine: both loops in one run, interleaved, the best of several rounds of each."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from anysim.errors import EngineError
from anysim.model.world import Actuation

BOXES = 5
CHUNK_STEPS = 4000
"""Physics steps of one timed chunk over all envs together, at least ten control steps."""


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
    """

    engine: str
    what: str
    actuation: str
    num_envs: int
    ours: float
    raw: float
    ratio: float
    cpu_ratio: float


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
    from anysim import registry
    from anysim.engine.base import SimEngine

    kinds = ((name, registry.load("engines", name)) for name in registry.names("engines"))
    return [name for name, kind in kinds if kind.raw_loop is not SimEngine.raw_loop and kind.availability().available]


def engine_cost(
    engine_name: str, num_envs: int, rounds: int = 7, actuation: Actuation = Actuation.IMPLICIT_PD
) -> StepCost:
    """Stepping through SimEngine, writing commands and reading the state every control step, against the raw loop.

    Raises:
        EngineError: the engine offers no raw loop.
    """
    from anysim.api import compile_world
    from anysim.engine.factory import create_simulation

    world = compile_world(panda_and_boxes())
    world = replace(world, physics=replace(world.physics, actuation=actuation))
    with create_simulation(engine_name) as engine:
        engine.create_world(world, num_envs)
        substeps = world.physics.substeps
        targets = engine.control.position
        engine.step(100)

        def ours() -> None:
            engine.set_control(position=targets)
            engine.step(substeps)
            state = engine.get_state()
            _ = state.joint_pos, state.joint_vel, state.body_pose, state.body_twist

        return _compare("engine", num_envs, ours, engine, substeps, rounds)


def env_cost(engine_name: str, num_envs: int, task: str = "pick_cube", rounds: int = 7) -> StepCost:
    """A whole task step (action, physics, status, reward, observation) against the raw loop of its world."""
    from anysim.api import make

    with make(task, engine=engine_name, num_envs=num_envs, overrides=["task.horizon=1000000000"]) as env:
        env.reset(seed=0)
        still = np.zeros((num_envs, env.action_dim))
        for _ in range(20):
            env.step(still)
        return _compare("env", num_envs, lambda: env.step(still), env.engine, env.engine.world.physics.substeps, rounds)


def _compare(what: str, num_envs: int, ours: Callable[[], Any], engine: Any, substeps: int, rounds: int) -> StepCost:
    raw_loop = engine.raw_loop()
    if raw_loop is None:
        raise EngineError(f"engine '{engine.name}' offers no raw loop to compare with")
    calls = max(10, CHUNK_STEPS // (num_envs * substeps))
    best: dict[str, Sequence[float]] = {}
    for _ in range(rounds):
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
    )
