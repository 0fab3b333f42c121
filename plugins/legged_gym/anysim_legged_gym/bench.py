"""Costs of a legged env: the engine's own loop, the simulator, rewards, heights and levels, in one run."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation, engine_class
from anysim.errors import EngineError
from anysim.model.world import World
from anysim_legged_gym.simulator import LeggedSimulator
from anysim_legged_gym.velocity import VelocityEnv

GOAL = {"mujoco": 0.6}
"""The least share of the engine's own speed that an env with rewards should have."""
MANY, FEW = 256, 16
"""Envs of an engine that steps them together, and of one with a world for each."""
SETTINGS: dict[str, Any] = {
    "sim": {"dt": 0.004},
    "control": {"stiffness": 40.0, "damping": 1.0, "decimation": 5, "action_scale": 0.3},
}
TILES: dict[str, Any] = {
    "terrain": {
        "mesh_type": "heightfield",
        "ground": {"kind": "tiles", "tiles": {"size": 6.0, "rows": 4, "choose": "curriculum"}},
    }
}


class LeggedCost(NamedTuple):
    """Control steps of all envs together, per second; the best of the rounds, which are interleaved.

    Attributes:
        engine: its name.
        num_envs: envs.
        raw: the engine's own loop, without sensors [env-steps/s].
        simulator: `step` and everything that is read after it [env-steps/s].
        env: with observations, rewards and resets [env-steps/s].
        ratio: env / raw, of wall time.
        cpu_ratio: the same of processor time, which other load on the machine disturbs less.
        heights: a height scan of 187 points, for each env [us].
        level: a reset with a new level, for each env [us].
    """

    engine: str
    num_envs: int
    raw: float
    simulator: float
    env: float
    ratio: float
    cpu_ratio: float
    heights: float
    level: float

    @property
    def missed(self) -> bool:
        """Whether `ratio` is below the engine's goal."""
        return self.ratio < GOAL.get(self.engine, 0.0)


def legged_cost(engine: str, num_envs: int | None = None, rounds: int = 10, robot: str = "unitree_go1") -> LeggedCost:
    """Measure one engine."""
    count = num_envs or (MANY if engine_class(engine).parallel else FEW)
    cfg = SETTINGS | {"asset": {"robot": robot}}
    with LeggedSimulator(cfg, engine, num_envs=count) as sim, create_simulation(engine) as bare:
        env = VelocityEnv(sim)
        bare.create_world(_without_extras(sim.engine.world, bare), count)
        substeps = sim.cfg.control.decimation
        draws = np.random.default_rng(0)
        actions = [draws.uniform(-0.2, 0.2, (count, sim.num_actions)) for _ in range(8)]
        turn = [0]

        def action() -> Any:
            turn[0] = (turn[0] + 1) % len(actions)
            return actions[turn[0]]

        def bare_simulator() -> None:
            sim.step(action())
            sim.post_physics_step()

        for _ in range(5):
            env.step(action())
        bare.step(substeps * 5)
        loop = bare.raw_loop()
        if loop is None:
            raise EngineError(f"{engine} has no loop of its own to compare with")
        found = _best([lambda: loop(substeps), bare_simulator, lambda: env.step(action())], rounds)
    walls, cpus = [wall for wall, _ in found], [cpu for _, cpu in found]
    heights, level = _ground_costs(engine, min(count, MANY), rounds, robot)
    raw, alone, whole = (count / wall for wall in walls)
    return LeggedCost(engine, count, raw, alone, whole, whole / raw, cpus[0] / cpus[2], heights, level)


def _without_extras(world: World, engine: SimEngine) -> World:
    """The same robots without sensors; and without dry friction where a library's own motors have none beside them."""
    world = replace(world, contact_sensors=())
    if engine.parallel:
        return world
    return replace(world, joints=tuple(replace(joint, friction=0.0) for joint in world.joints))


def _ground_costs(engine: str, count: int, rounds: int, robot: str) -> tuple[float, float]:
    with LeggedSimulator(SETTINGS | TILES | {"asset": {"robot": robot}}, engine, num_envs=count) as sim:
        base, every = sim.engine.get_state().body_pose[:, sim.layout.root], np.arange(count)
        up = np.ones(count, dtype=bool)

        def climb() -> None:
            sim.update_terrain_curriculum(every, up, ~up)
            sim.reset_idx(every)

        found = _best([lambda: sim.ground.around(base), climb], rounds)
    return found[0][0] / count * 1e6, found[1][0] / count * 1e6


def _best(calls: Sequence[Callable[[], object]], rounds: int) -> list[tuple[float, float]]:
    """The best times [s] of each, of the clock and of the processor, in turn so that all meet the same load."""
    best = [(np.inf, np.inf)] * len(calls)
    for call in calls:
        call()
    for _ in range(rounds):
        for i, call in enumerate(calls):
            wall, cpu = time.perf_counter(), time.process_time()
            for _ in range(5):
                call()
            spent = (time.perf_counter() - wall) / 5, (time.process_time() - cpu) / 5
            best[i] = min(best[i][0], spent[0]), min(best[i][1], spent[1])
    return best
