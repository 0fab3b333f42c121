"""Costs of families: a world with one, and without it; particles are in a tank with a box on top."""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import anysim
from anysim.task.env import TaskEnv
from anysim_particles.bench_cases import case_of

SETTLE = 15
"""Control steps until it is measured."""
SUBSTEPS = 5
EDGES = {"fluid": 0.01, "sand": 2.5 * 0.005, "rice": 3.125e-3}
"""[m] of the cell of a particle, by family."""


class FamilyCost(NamedTuple):
    """Physics steps of 4 ms.

    Attributes:
        engine, family, particles, num_envs: what was measured; particles are the points of any matter, or the bodies of
            what an engine holds.
        per_second: steps of one env per second of processor time.
        wall_per_second: steps of all envs together per second.
        alone: steps of one env per second of processor time without the matter.
        one_by_one: the same in calls of one step each.
        solver: steps of one env per second of processor time of the solver of the matter alone; None if not measured.
    """

    engine: str
    family: str
    particles: int
    num_envs: int
    per_second: float
    wall_per_second: float
    alone: float
    one_by_one: float
    solver: float | None = None


def tank(edge: float, height: float, wall: float = 0.02) -> dict[str, Any]:
    """A world with four walls on the ground around a square of an edge [m]."""
    out = edge / 2 + wall / 2
    walls = {
        "west": ([wall, edge + 2 * wall, height], [-out, 0.0, height / 2]),
        "east": ([wall, edge + 2 * wall, height], [out, 0.0, height / 2]),
        "south": ([edge, wall, height], [0.0, -out, height / 2]),
        "north": ([edge, wall, height], [0.0, out, height / 2]),
    }
    return {
        "objects": {name: {"source": {"box": size}, "fixed": True} for name, (size, _) in walls.items()},
        "layout": {name: {"position": place} for name, (_, place) in walls.items()},
    }


def world_of(kind: str, particles: int) -> dict[str, Any]:
    """The tank with about so many particles of a family, as deep as it is wide, and a box over it."""
    size = EDGES[kind]
    members = 4 if kind == "rice" else 1
    side = max(3, round((particles / members) ** (1 / 3)))
    edge, deep = side * size, side * size
    if kind == "rice":  # cells of grains are longer than wide
        edge = size * 3 * max(2, round((particles / members / 3) ** (1 / 3)))
        deep = size * max(1, round(particles / members / ((edge // 0.00725) * (edge // size))))
    matter: dict[str, Any] = {"kind": kind, "box": [edge + 1e-6, edge + 1e-6, deep + 1e-6]}
    if kind == "sand":
        matter["radius"] = 0.005
    world = tank(edge + 1e-6, 3 * deep + 0.05)
    world["objects"]["float"] = {"source": {"box": [edge / 3] * 3}, "density": 400.0}
    world["layout"]["float"] = {"position": [0.0, 0.0, deep + edge / 6 + 0.01]}
    return {**world, "families": {"matter": matter}}


def cost(kind: str, particles: int, num_envs: int, engine: str, steps: int) -> FamilyCost:
    """What a physics step costs with matter at rest, and without it; `particles` is of those that are made of them."""
    world = world_of(kind, particles) if kind in EDGES else case_of(kind)
    return cost_in(world, kind, num_envs, engine, steps)


def cost_in(
    world: dict[str, Any],
    called: str,
    num_envs: int,
    engine: str,
    steps: int,
    solver: Callable[[TaskEnv], Callable[[], object]] | None = None,
) -> FamilyCost:
    """The same in a world whose family or object `matter` is called so in the table.

    `solver` gives what makes one physics step of the solver alone, from what matter is like in the first env.
    """
    with _made(world, engine, num_envs) as env:
        env.reset(seed=0)
        action = np.zeros((num_envs, 0))
        _run(lambda: env.step(action), SETTLE)
        cpu, wall = _run(lambda: env.step(action), steps)
        bare_solver = None if solver is None else 1.0 / _run(solver(env), SUBSTEPS * steps)[0]
        if world["families"]:
            assert env.families is not None
            there = env.families.state("matter").points.shape[1]
        else:
            entities = [entity for entity in env.engine.world.entities if entity.category == "matter"]
            there = sum(entity.body_stop - entity.body_start for entity in entities)
    bare = {key: {n: one for n, one in world[key].items() if n != "matter"} for key in ("objects", "layout")}
    with _made({**world, **bare, "families": {}}, engine, num_envs) as env:
        env.reset(seed=0)
        _run(lambda: env.engine.step(SUBSTEPS), 4)
        alone, _ = _run(lambda: env.engine.step(SUBSTEPS), 20)
        one, _ = _run(lambda: [env.engine.step(1) for _ in range(SUBSTEPS)], 20)
    done = SUBSTEPS * num_envs
    rates = done / cpu, done / wall, done / alone, done / one
    return FamilyCost(engine, called, there, num_envs, *rates, bare_solver)


def _made(world: dict[str, Any], engine: str, num_envs: int) -> Any:
    run = {"engine": engine, "physics": {"dt": 0.004, "control_dt": 0.004 * SUBSTEPS}, "world": world}
    return anysim.make(
        {**run, "task": {"observations": {"policy": ["last_action"]}, "horizon": 10_000}}, num_envs=num_envs
    )


def _run(work: Callable[[], object], times: int) -> tuple[float, float]:
    """Seconds of processor time and of wall time of one call."""
    cpu, wall = time.process_time(), time.perf_counter()
    for _ in range(times):
        work()
    return (time.process_time() - cpu) / times, (time.perf_counter() - wall) / times
