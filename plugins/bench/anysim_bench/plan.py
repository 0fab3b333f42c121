"""Planning: services against their planner called directly, the quality of plans, and what they do to the loop.

Requests go from free configurations to the tool poses of others, all drawn from a seed. All sides plan the same
requests in turns, roboplan alone among them, and the best of each counts. A path counts as free if no shapes touch
0.005 rad by 0.005 rad, which is looked at after all planning is over, with nothing of the planner.
"""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from anysim import compile_world, make
from anysim.conventions import Array
from anysim.kinematics.chain import Chain
from anysim.model.world import World
from anysim.planning.api import inverse_kinematics
from anysim.planning.motion import (
    Budget,
    MotionPlanner,
    PlanAnswer,
    PlanRequest,
    PlanStatus,
    Scene,
    Scenes,
    motion_planner,
)
from anysim.planning.service import PlanFuture, PlannerService, planner_service
from anysim.task.env import TaskEnv
from anysim_bench.free_paths import Touching, dense
from anysim_bench.plan_bare import BareTurns, bare, length
from anysim_bench.plan_costs import PairCost, PlanCost, ServiceCost
from anysim_bench.plan_requests import DEADLINE, Arms
from anysim_bench.resets import resident_mib

WORKERS = (1, 2)
POSTURES = 1_000
"""Requests for joint positions alone, one candidate each."""
ROUNDS = 3
"""Turns of all sides on the requests."""
BLOCKS, STEPS = 8, 200
"""Turns of an idle and a busy loop, and the steps of each."""


def plan_cost(
    planner: str = "rrt",
    task: str = "pick_cube",
    requests: int = 50,
    goals: int = 16,
    engine: str | None = None,
    services: Sequence[str] = ("processes", "threads"),
    dual: str = "baxter",
    pairs: int = 0,
) -> PlanCost:
    """Measure a planner with the arm of a task's first robot, and `pairs` plans of the two arms of the robot `dual`.

    Raises:
        EngineError: the task's first robot has no tool, or `dual` not two that move apart.
    """
    with make(task, engine=engine, num_envs=16, overrides=["record=null"]) as env:
        env.reset(seed=1)
        world, state, made = env.engine.world, env.engine.get_state(), motion_planner(env.engine.world, planner)
        scenes = Scenes(world, env.num_envs)
        scenes.update(state.body_pose)
        scene = scenes.scene(0)
        arms = Arms(world, made, 1)
        begun = time.perf_counter()
        asked = arms.requests(scene, state.joint_pos[0], requests, goals)
        made.warm_up(asked[0], scene)
        made.plan(asked[0], scene, Budget(DEADLINE))
        first = time.perf_counter() - begun
        built, grown, taken = _worlds(world, planner, asked[0], scene, scenes.scene(1))
        other = bare(world, asked, scene)
        answers, spent, found = _in_turns(world, made, planner, services, asked, scene, other)
        paths = [answer.trajectory.joint_pos for answer in answers if answer.trajectory is not None]
        touching = Touching(world)

        def is_free(path: Array) -> bool:
            return not touching.any(arms.bodies(scene, dense(path), state.joint_pos[0]))

        free = [is_free(path) for path in paths]
        beside = None if other is None else other.cost(is_free)
        idle, busy = _stalls(env, planner, services, asked, scene)
        found = [
            one._replace(busy_p99_ms=1e3 * float(np.quantile(busy[one.service], 0.99))) if one.workers == 1 else one
            for one in found
        ]
        if beside is not None:
            cpu = 1e-3 * beside.cpu_ms
            found = [o._replace(bare_ratio=o.rate / beside.rate, bare_cpu_ratio=cpu * o.cpu_rate) for o in found]
        postures = _posture_rates(world, made, planner, services, asked, scene) if "ik" in made.capabilities else None
        robot, tool = world.robots[0], next(iter(arms.tools))
        chain = Chain.from_world(world, robot.name, next(iter(robot.channels)), tool, joints=arms.tools[tool])
    return PlanCost(
        planner,
        task,
        requests,
        goals,
        sum(answer.status is PlanStatus.OK for answer in answers) / requests,
        float(np.mean(free)) if free else 0.0,
        float(np.mean([length(path) for path in paths] or [0.0])),
        float(np.mean([a.trajectory.times[-1] for a in answers if a.trajectory is not None] or [0.0])),
        1e3 * float(np.median(spent)),
        1e3 * float(np.quantile(spent, 0.95)),
        1e3 * first,
        1e3 * built,
        grown,
        1e3 * taken,
        sum(part.nbytes for part in scene[1:]) / 2**10,
        requests / sum(spent),
        beside,
        found,
        _ik_rate(chain),
        postures,
        1e3 * float(np.quantile(idle, 0.99)),
        _pairs(planner, dual, pairs) if pairs else None,
    )


def _worlds(world: World, planner: str, request: PlanRequest, scene: Scene, other: Scene) -> tuple[float, float, float]:
    """Seconds and MiB of a planning world, and seconds to put another scene into it."""
    made, built, taken = list[MotionPlanner](), list[float](), list[float]()
    before = resident_mib()
    for _ in range(10):
        made.append(motion_planner(world, planner))
        begun = time.perf_counter()
        made[-1].warm_up(request, scene)
        built.append(time.perf_counter() - begun)
    grown = (resident_mib() - before) / len(made)
    for k in range(20):
        begun = time.perf_counter()
        made[0].warm_up(request, scene if k % 2 else other)
        taken.append(time.perf_counter() - begun)
    return float(np.median(built)), grown, float(np.median(taken))


def _in_turns(
    world: World,
    made: MotionPlanner,
    planner: str,
    names: Sequence[str],
    asked: list[PlanRequest],
    scene: Scene,
    other: BareTurns | None,
) -> tuple[list[PlanAnswer], list[float], list[ServiceCost]]:
    """Answers, seconds of each plan alone in the best turn, and what services take for all of them."""
    answers, spent, alone_cpu = list[PlanAnswer](), [np.inf], np.inf
    with ExitStack() as stack:
        running, start = dict[tuple[str, int], PlannerService](), dict[tuple[str, int], float]()
        for kind in [(name, workers) for name in names for workers in WORKERS]:
            begun = time.perf_counter()
            running[kind] = stack.enter_context(planner_service(world, planner, kind[1], kind[0]))
            for future in [running[kind].submit(asked[0], scene) for _ in range(kind[1])]:
                future.result()
            start[kind] = time.perf_counter() - begun
        wall, cpu, same = dict.fromkeys(running, np.inf), dict.fromkeys(running, np.inf), dict.fromkeys(running, True)
        for _ in range(ROUNDS):
            processor = time.process_time()
            answers, times = _one_by_one(made, asked, scene)
            spent = min(spent, times, key=sum)
            alone_cpu = min(alone_cpu, time.process_time() - processor)
            if other is not None:
                other.turn()
            for kind, service in running.items():
                begun, processor, before = time.perf_counter(), time.process_time(), service.counts.processor
                found = [f.result() for f in [service.submit(request, scene) for request in asked]]
                wall[kind] = min(wall[kind], time.perf_counter() - begun)
                here = time.process_time() - processor  # planners in threads are part of it
                there = service.counts.processor - before if service.beside else 0.0
                cpu[kind] = min(cpu[kind], here + there)
                same[kind] &= all(_same(a, b) for a, b in zip(answers, found, strict=True))
                service.harvest(0)
    best = len(asked) / sum(spent)
    costs = [
        ServiceCost(
            *kind,
            1e3 * start[kind],
            (rate := len(asked) / wall[kind]),
            rate / best,
            len(asked) / cpu[kind],
            alone_cpu / cpu[kind],
            ok,
        )
        for kind, ok in same.items()
    ]
    return answers, spent, costs


def _stalls(
    env: TaskEnv, planner: str, names: Sequence[str], asked: list[PlanRequest], scene: Scene
) -> tuple[list[float], dict[str, list[float]]]:
    """Seconds of control steps of all envs: with nothing to plan, and with all requests in flight in each service.

    What has been answered is asked again in the next step, whose time that is part of.
    """
    action = np.zeros((env.num_envs, env.action_dim))
    idle, busy = list[float](), {name: list[float]() for name in names}

    def step(service: PlannerService | None = None, futures: list[PlanFuture] | None = None) -> float:
        if not env.running.all():
            env.reset(mask=~env.running)
        begun = time.perf_counter()
        if service is not None and futures is not None:
            futures[:] = [service.submit(f.request, scene, latency=None) if f.done else f for f in futures]
            service.flush()
        env.step(action)
        if service is not None:
            service.harvest(0)
        return time.perf_counter() - begun

    for _ in range(20):
        step()
    with ExitStack() as stack:
        running = {n: stack.enter_context(planner_service(env.engine.world, planner, 1, n)) for n in names}
        for service in running.values():
            service.submit(asked[0], scene).result()
        for _ in range(BLOCKS):
            idle.extend(step() for _ in range(STEPS))
            for name, service in running.items():
                futures = [service.submit(request, scene, latency=None) for request in asked]
                busy[name].extend(step(service, futures) for _ in range(STEPS))
                for future in futures:
                    future.cancel()
                service.submit(asked[0], scene).result()  # after which its worker is idle
    return idle, busy


def _pairs(planner: str, robot: str, count: int) -> PairCost:
    """Plan two arms from free configurations to the tool poses of others."""
    text = {"world": {"terrain": "plane", "robots": {"robot": {"robot": robot, "position": [0, 0, 0]}}}}
    world = compile_world(text)
    scene, initial = Scenes(world, 1).scene(0), np.array([joint.initial for joint in world.joints])
    made = motion_planner(world, planner)
    arms, touching = Arms(world, made, 2), Touching(world)
    asked = arms.requests(scene, initial, count, 1)
    reached, free = 0, 0
    made.warm_up(asked[0], scene)
    answers, spent = _one_by_one(made, asked, scene)
    for answer in answers:
        reached += answer.status is not PlanStatus.NO_IK
        if answer.trajectory is not None:
            free += not touching.any(arms.bodies(scene, dense(answer.trajectory.joint_pos), initial))
    solved = sum(answer.status is PlanStatus.OK for answer in answers)
    return PairCost(robot, count, reached, solved, free, 1e3 * float(np.median(spent)))


def _one_by_one(
    made: MotionPlanner, asked: Sequence[PlanRequest], scene: Scene
) -> tuple[list[PlanAnswer], list[float]]:
    """Answers and the seconds of each."""
    answers, spent = list[PlanAnswer](), list[float]()
    for request in asked:
        begun = time.perf_counter()
        answers.append(made.plan(request, scene, Budget(DEADLINE)))
        spent.append(time.perf_counter() - begun)
    return answers, spent


def _ik_rate(chain: Chain, count: int = 4_000) -> float:
    solver, rng = inverse_kinematics(chain), np.random.default_rng(7)
    base = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (count, 1))
    q = rng.uniform(chain.lower, chain.upper, (count, len(chain)))
    seeds, keys = rng.uniform(chain.lower, chain.upper, q.shape), np.arange(count, dtype=np.uint64)
    targets, best = chain.tool_pose(base, q), 0.0
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        solved = solver.solve(targets, base, seeds, random_restarts=50, rng_seeds=keys).converged.sum()
        best = max(best, float(solved) / (time.perf_counter() - begun))
    return best


def _posture_rates(
    world: World, made: MotionPlanner, planner: str, names: Sequence[str], asked: list[PlanRequest], scene: Scene
) -> dict[str, float]:
    """Requests a second for joint positions at the first candidate of each goal, in the best of some turns."""
    some = [replace(r, path=False, goals=tuple(replace(g, poses=g.poses[:1]) for g in r.goals)) for r in asked]
    many = [replace(some[k % len(some)], seed=k) for k in range(POSTURES)]
    best = dict.fromkeys(("alone", *names), np.inf)
    with ExitStack() as stack:
        running = {name: stack.enter_context(planner_service(world, planner, 1, name)) for name in names}
        for service in running.values():
            service.submit(many[0], scene).result()
        for _ in range(ROUNDS):
            best["alone"] = min(best["alone"], sum(_one_by_one(made, many, scene)[1]))
            for name, service in running.items():
                begun = time.perf_counter()
                for future in [service.submit(request, scene) for request in many]:
                    future.result()
                best[name] = min(best[name], time.perf_counter() - begun)
                service.harvest(0)
    return {name: POSTURES / seconds for name, seconds in best.items()}


def _same(a: PlanAnswer, b: PlanAnswer) -> bool:
    if a.trajectory is None or b.trajectory is None:
        return a.status is b.status and a.trajectory is b.trajectory
    return a.chosen == b.chosen and all(map(np.array_equal, a.trajectory, b.trajectory))
