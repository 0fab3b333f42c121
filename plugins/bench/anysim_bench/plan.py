"""Planning: a service's rate against its planner called directly, the quality of plans, and what it does to the loop.

Requests go from free configurations to the tool poses of others, all drawn from a seed. A path counts as free if its
planner finds it so 0.005 rad by 0.005 rad after all planning is over.
"""

import time
from typing import NamedTuple

import numpy as np

from anysim import make
from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.kinematics.chain import Chain
from anysim.planning.api import inverse_kinematics
from anysim.planning.motion import Budget, PlanAnswer, PlanRequest, PlanStatus, Scene, ToolGoal, motion_planner
from anysim.planning.scenes import Scenes
from anysim.planning.service import planner_service
from anysim.task.env import TaskEnv

RATIO_GOAL = 0.85
"""Plans a second of a service with one thread, of those of the planner alone."""
STALL_GOAL_MS = 2.0
"""By which the 99th percentile of a control step may grow while requests are in flight."""
IK_GOAL = 20_000
"""Solutions a second."""


class PlanCost(NamedTuple):
    """One planner on one task; times in milliseconds.

    Attributes:
        planner, task: names.
        requests, goals: how many requests, of how many candidates each.
        solved, free: shares of the requests, and of the paths found.
        length: [rad] mean length of a path.
        plan_ms, plan_p95_ms: median and 95th percentile of a plan alone.
        first_ms: the first plan, in which the planning world is built and kernels are loaded.
        alone: plans a second of the planner called directly.
        services: plans a second of the service, by threads.
        same: whether the services gave the answers of the planner alone, bit for bit.
        ik: solutions of inverse kinematics a second, from random configurations.
        step_p99_ms, busy_p99_ms: 99th percentile of a control step of 16 envs, without and with requests in flight.
        busy_steps: how many steps were measured with requests in flight.
    """

    planner: str
    task: str
    requests: int
    goals: int
    solved: float
    free: float
    length: float
    plan_ms: float
    plan_p95_ms: float
    first_ms: float
    alone: float
    services: dict[str, float]
    same: bool
    ik: float
    step_p99_ms: float
    busy_p99_ms: float
    busy_steps: int


def plan_cost(
    planner: str = "rrt", task: str = "pick_cube", requests: int = 50, goals: int = 16, engine: str | None = None
) -> PlanCost:
    """Measure a planner with the arm of a task's first robot.

    Raises:
        EngineError: the task's first robot has no tool.
    """
    with make(task, engine=engine, num_envs=16, overrides=["record=null"]) as env:
        env.reset(seed=1)
        world = env.engine.world
        if not world.robots or not world.robots[0].tools:
            raise EngineError(f"'{task}' has no robot with a tool; choose a task with an arm, such as pick_cube")
        robot = world.robots[0]
        channel, tool = next(iter(robot.channels)), next(iter(robot.tools))
        chain = Chain.from_world(world, robot.name, channel, tool)
        scenes = Scenes(world, env.num_envs)
        scenes.update(env.engine.get_state().body_pose)
        scene = scenes.scene(0)
        asked = _requests(planner, chain, robot.name, tool, scene, requests, goals, env)
        made = motion_planner(world, planner)
        begun = time.perf_counter()
        made.plan(asked[0], scene, Budget(60.0))
        first = time.perf_counter() - begun
        answers, spent = list[PlanAnswer](), list[float]()
        for request in asked:
            begun = time.perf_counter()
            answers.append(made.plan(request, scene, Budget(60.0)))
            spent.append(time.perf_counter() - begun)
        services, same = dict[str, float](), True
        for threads in (1, 2):
            with planner_service(world, planner, threads) as service:
                for future in [service.submit(asked[0], scene) for _ in range(threads)]:
                    future.result()
                begun = time.perf_counter()
                found = [f.result() for f in [service.submit(request, scene) for request in asked]]
                services[str(threads)] = requests / (time.perf_counter() - begun)
                same &= all(_same(a, b) for a, b in zip(answers, found, strict=True))
        idle, busy = _stalls(env, planner, asked, scene)
        paths = [
            (request, answer.trajectory.joint_pos)
            for request, answer in zip(asked, answers, strict=True)
            if answer.trajectory is not None
        ]
        return PlanCost(
            planner,
            task,
            requests,
            goals,
            sum(answer.status is PlanStatus.OK for answer in answers) / requests,
            float(np.mean([made.is_free(request, scene, path) for request, path in paths])) if paths else 0.0,
            float(np.mean([np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for _, path in paths] or [0.0])),
            1e3 * float(np.median(spent)),
            1e3 * float(np.quantile(spent, 0.95)),
            1e3 * first,
            requests / sum(spent),
            services,
            same,
            _ik_rate(chain),
            1e3 * float(np.quantile(idle, 0.99)),
            1e3 * float(np.quantile(busy, 0.99)),
            len(busy),
        )


def _requests(
    planner: str, chain: Chain, robot: str, tool: str, scene: Scene, count: int, goals: int, env: TaskEnv
) -> list[PlanRequest]:
    """From one drawn free configuration to the tool poses of others."""
    made = motion_planner(env.engine.world, planner)
    rng, free = np.random.default_rng(20_000), list[Array]()
    while len(free) < count + goals:
        q = rng.uniform(chain.lower, chain.upper)
        if made.is_free(PlanRequest(chain.joint_names, q, joint_goal=q), scene, q[None]):
            free.append(q)
    base = scene.body_pose[chain.root]
    poses = chain.tool_pose(np.tile(base, (len(free), 1)), np.array(free))
    return [
        PlanRequest(
            chain.joint_names, free[i], (ToolGoal(robot, tool, poses[i + 1 : i + 1 + goals]),), seed=i, deadline=60.0
        )
        for i in range(count)
    ]


def _stalls(env: TaskEnv, planner: str, asked: list[PlanRequest], scene: Scene) -> tuple[list[float], list[float]]:
    """Seconds of control steps of all envs: with nothing to plan, and while requests are in flight."""
    action = np.zeros((env.num_envs, env.action_dim))
    idle, busy = list[float](), list[float]()

    def step() -> float:
        if not env.running.all():
            env.reset(mask=~env.running)
        begun = time.perf_counter()
        env.step(action)
        return time.perf_counter() - begun

    for _ in range(10):
        step()
    idle.extend(step() for _ in range(200))
    with planner_service(env.engine.world, planner, 1) as service:
        service.submit(asked[0], scene).result()
        while len(busy) < 200:
            futures = [service.submit(request, scene) for request in asked]
            service.flush()
            before = len(busy)
            while not all(future.done for future in futures):
                busy.append(step())
            for future in futures:
                future.result()
            if len(busy) == before:  # planned faster than a step takes
                busy.append(step())
    return idle, busy


def _ik_rate(chain: Chain, count: int = 4_000) -> float:
    solver, rng = inverse_kinematics(chain), np.random.default_rng(7)
    base = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (count, 1))
    q = rng.uniform(chain.lower, chain.upper, (count, len(chain)))
    seeds, keys = rng.uniform(chain.lower, chain.upper, q.shape), np.arange(count, dtype=np.uint64)
    targets, best = chain.tool_pose(base, q), 0.0
    for _ in range(3):
        begun = time.perf_counter()
        solved = solver.solve(targets, base, seeds, random_restarts=50, rng_seeds=keys).converged.sum()
        best = max(best, float(solved) / (time.perf_counter() - begun))
    return best


def _same(a: PlanAnswer, b: PlanAnswer) -> bool:
    if a.trajectory is None or b.trajectory is None:
        return a.status is b.status and a.trajectory is b.trajectory
    return a.chosen == b.chosen and all(map(np.array_equal, a.trajectory, b.trajectory))
