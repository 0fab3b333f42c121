"""Costs of planning, and the goals that they miss."""

from typing import NamedTuple

from anysim.planning.service import default_service
from anysim_bench.plan_bare import BareCost

RATIO_GOAL = 0.85
"""Plans a second of a service, of those of its planner called directly, and of those of roboplan alone."""
STALL_GOAL_MS = 2.0
"""By which the 99th percentile of a control step may grow while requests are in flight."""
IK_GOAL = 20_000
"""Solutions a second."""


class ServiceCost(NamedTuple):
    """A planner service.

    Attributes:
        service, workers: its name, and how many workers.
        start_ms: until it has answered a first request, with its kernels compiled before.
        rate: plans a second.
        ratio: of the planner's alone, by the clock on the wall.
        cpu_rate: plans a second of processor time, all that workers and this process compute for it.
        cpu_ratio: of the planner's alone, by that.
        bare_ratio, bare_cpu_ratio: of roboplan's alone, by both; None where it is not installed.
        same: whether it gave the answers of the planner alone, bit for bit.
        busy_p99_ms: 99th percentile of a control step of 16 envs with requests in flight; None for several workers.
    """

    service: str
    workers: int
    start_ms: float
    rate: float
    ratio: float
    cpu_rate: float
    cpu_ratio: float
    same: bool
    bare_ratio: float | None = None
    bare_cpu_ratio: float | None = None
    busy_p99_ms: float | None = None


class PairCost(NamedTuple):
    """Two arms planned together: candidates that both are known to reach.

    Attributes:
        robot: of the catalogue.
        pairs: how many requests.
        reached, solved, free: how many had joint positions for both tools, a path, and a path that is free.
        plan_ms: median of a plan.
    """

    robot: str
    pairs: int
    reached: int
    solved: int
    free: int
    plan_ms: float


class PlanCost(NamedTuple):
    """One planner on one task; times in milliseconds.

    Attributes:
        planner, task: names.
        requests, goals: how many requests, of how many candidates each.
        solved, free: shares of the requests, and of the paths found.
        length: [rad] mean length of a path.
        duration: [s] mean time of a trajectory.
        plan_ms, plan_p95_ms: median and 95th percentile of a plan alone.
        first_ms: the first plan, in which the planning world is built and kernels are loaded.
        world_ms, world_mib: time and memory [MiB] of another planning world, which serves all envs.
        scene_ms, scene_kib: to put an env's scene into it, and what an env keeps [KiB].
        alone: plans a second of the planner called directly.
        bare: roboplan alone on the same requests; None where it is not installed.
        services: what runs around it.
        ik: solutions of inverse kinematics a second, from random configurations.
        postures: requests a second for free joint positions without a path, by who answers: the planner `alone`, one by
            one, and each service with one worker. None where the planner answers motions only.
        step_p99_ms: 99th percentile of a control step of 16 envs with nothing to plan.
        pairs: two arms, where asked for.
    """

    planner: str
    task: str
    requests: int
    goals: int
    solved: float
    free: float
    length: float
    duration: float
    plan_ms: float
    plan_p95_ms: float
    first_ms: float
    world_ms: float
    world_mib: float
    scene_ms: float
    scene_kib: float
    alone: float
    bare: BareCost | None
    services: list[ServiceCost]
    ik: float
    postures: dict[str, float] | None
    step_p99_ms: float
    pairs: PairCost | None

    @property
    def missed(self) -> list[str]:
        """What is not as it should be, a sentence each; of what takes time the default service counts alone."""
        said = [f"{self.free:.1%} of the paths are free; all should be"] * (self.free < 1.0)
        said += [f"'{one.service}' answers otherwise than its planner" for one in self.services if not one.same]
        for one in self.services:
            if one.service != default_service():
                continue
            name = f"'{one.service}' with workers: {one.workers}"
            if max(one.ratio, one.cpu_ratio) < RATIO_GOAL:
                said.append(f"{name} plans {one.ratio:.2f} of its planner's rate; at least {RATIO_GOAL:g} is the goal")
            if one.bare_ratio is not None and max(one.bare_ratio, one.bare_cpu_ratio or 0.0) < RATIO_GOAL:
                said.append(
                    f"{name} plans {one.bare_ratio:.2f} of roboplan's rate; at least {RATIO_GOAL:g} is the goal"
                )
            if one.busy_p99_ms is not None and one.busy_p99_ms > self.step_p99_ms + STALL_GOAL_MS:
                grown = one.busy_p99_ms - self.step_p99_ms
                said.append(
                    f"{name} adds {grown:.2f} ms to the 99th percentile of a step; {STALL_GOAL_MS:g} is the most"
                )
        if (two := self.pairs) is not None and not two.reached == two.solved == two.free == two.pairs:
            said.append(
                f"of {two.pairs} pairs {two.reached} are reached, {two.solved} solved, {two.free} free; all should be"
            )
        return said
