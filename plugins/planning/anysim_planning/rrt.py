"""The planner of motion `rrt`: own goal sets, the straight line first, RRT-Connect, a time law, and a last check."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim.planning.motion import (
    Budget,
    MotionPlanner,
    PlanAnswer,
    PlanRequest,
    PlanStatus,
    RequestKind,
    Scene,
    Trajectory,
)
from anysim_planning.goals import GoalConfiguration, GoalSolver, ReachQuery
from anysim_planning.lines import straight_line
from anysim_planning.scene import PlanningWorld, topology
from anysim_planning.search import connect, dense, edge_check, shortened
from anysim_planning.time_law import Speeds, cautious_speeds, timed

CHECKED = 0.005
"""[rad] or [m] between the configurations of the last check."""
ATTEMPTS = ((0.02, 0.15), (0.005, 0.0))
"""Steps of the search, and how far corners are cut: the second where the last check finds fault with the first."""
CANDIDATES = 3
"""Goal configurations that a path is looked for, the nearest first."""
KEPT = 12
"""Worlds that are kept, the last ones used."""


class RrtPlanner(MotionPlanner):
    """RRT-Connect with edges checked in batches by Coal."""

    name = "rrt"
    version = "1"
    capabilities = frozenset({"attached", "ik", "independent", "joint_goal", "paired", "straight"})
    fused = frozenset({RequestKind.IK, RequestKind.DUAL_IK})
    speeds: Speeds = staticmethod(cautious_speeds)
    """How fast paths are gone along."""

    def __init__(self, world: World, solver: str = "numba_ik") -> None:
        """`solver`: of inverse kinematics, by name."""
        super().__init__(world)
        self._goals = GoalSolver(world, solver)
        self._worlds: OrderedDict[object, PlanningWorld] = OrderedDict()
        self._shapes: dict[object, Any] = {}

    def world_of(self, request: PlanRequest, scene: Scene) -> PlanningWorld:
        """The collision checks of a request, everything where the scene has it."""
        key = topology(request)
        if key not in self._worlds:
            self._worlds[key] = PlanningWorld(self.world, request, self._shapes)
            if len(self._worlds) > KEPT:
                self._worlds.popitem(last=False)
        self._worlds.move_to_end(key)
        self._worlds[key].take(scene, request.attached)
        self._worlds[key].rest(np.asarray(request.start, dtype=float), request.padding)
        return self._worlds[key]

    def warm_up(self, request: PlanRequest, scene: Scene) -> None:
        """Build the collision world, and load the solvers, which are compiled where no compiled ones are kept."""
        self.world_of(request, scene)
        for goal in request.goals:
            if goal.enabled:
                self._goals.arm(request, goal)

    def is_free(self, request: PlanRequest, scene: Scene, joint_pos: Array) -> bool:
        """Whether a path (T, K) is free, 0.005 rad by 0.005 rad."""
        return _free(self.world_of(request, scene), joint_pos)

    def plan(self, request: PlanRequest, scene: Scene, budget: Budget) -> PlanAnswer:
        """Search, or where no path is asked for solve the goals."""
        request.check()
        if not request.path:
            return self._solved([request], [scene], [budget])[0]
        clock, timings = perf_counter(), dict[str, float]()
        world = self.world_of(request, scene)
        start = np.asarray(request.start, dtype=float)
        width = next((len(goal.poses) for goal in request.goals if goal.enabled), 1)

        def answer(status: PlanStatus, message: str = "", **more: Any) -> PlanAnswer:
            more.setdefault("goal_status", (status,) * width)
            more |= {"timings": timings, "solver": self._signature, "world_version": scene.version}
            return PlanAnswer(status, message=message, **more)

        def passed(stage: str) -> None:
            nonlocal clock
            now = perf_counter()
            timings[stage] = timings.get(stage, 0.0) + now - clock
            clock = now

        if world.hits(start[None])[0]:
            pairs = ", ".join(f"'{a}' with '{b}'" for a, b in world.touching(start)[:4])
            return answer(PlanStatus.START_IN_COLLISION, f"the motion would begin in a collision of {pairs}")
        passed("scene")
        if request.joint_goal is not None:
            q = np.asarray(request.joint_goal, dtype=float)
            found, statuses = [GoalConfiguration((0,), q)], [PlanStatus.OK]
            if world.hits(q[None])[0] or (q < world.lower - 1e-9).any() or (q > world.upper + 1e-9).any():
                return answer(PlanStatus.NO_IK, "the joint positions asked for collide, or are beyond a joint's limit")
        else:
            found, reachable = self._goals.reach(request, scene, world)
            statuses = _statuses(found, width)
            if not found:
                return answer(PlanStatus.NO_IK, _unreached(reachable))
        passed("ik")
        for one in found[:CANDIDATES]:
            trajectory = self._motion(request, scene, world, one, budget, passed)
            if spent := budget.spent:
                return answer(spent, "it was stopped before a path was found")
            first = _first(one)
            if trajectory is not None:
                whole = tuple(PlanStatus.OK if g == first else status for g, status in enumerate(statuses))
                margins = _margins(world, trajectory.joint_pos)
                passed("margins")
                return answer(
                    PlanStatus.OK, goal_status=whole, chosen=one.chosen, trajectory=trajectory, margins=margins
                )
            statuses[first] = PlanStatus.NO_PATH
        kind = "straight line" if request.straight is not None else "path"
        tried = tuple(PlanStatus.NO_PATH if status is PlanStatus.OK else status for status in statuses)
        return answer(
            PlanStatus.NO_PATH, f"no free {kind} to the nearest {CANDIDATES} configurations", goal_status=tried
        )

    def plan_all(
        self, requests: Sequence[PlanRequest], scenes: Sequence[Scene], budgets: Sequence[Budget]
    ) -> list[PlanAnswer]:
        """Joint positions are solved together, motions one after the other."""
        if any(request.path for request in requests):
            return super().plan_all(requests, scenes, budgets)
        for request, budget in zip(requests, budgets, strict=True):
            request.check()
            budget.begin()
        return self._solved(requests, scenes, budgets)

    def _solved(
        self, requests: Sequence[PlanRequest], scenes: Sequence[Scene], budgets: Sequence[Budget]
    ) -> list[PlanAnswer]:
        """Answers of requests without a path."""
        begun, answers = perf_counter(), list[PlanAnswer]()
        asked = [ReachQuery(r, s, partial(self.world_of, r, s)) for r, s in zip(requests, scenes, strict=True)]
        for one, reach, budget in zip(asked, self._goals.reach_all(asked), budgets, strict=True):
            width = len(reach.reachable)
            more: dict[str, Any] = {"solver": self._signature, "world_version": one.scene.version}
            more["goal_status"] = tuple(_statuses(reach.found, width))
            if spent := budget.spent:
                more["goal_status"] = (spent,) * width
                answers.append(PlanAnswer(spent, message="it was stopped before it was answered", **more))
            elif not reach.found:
                answers.append(PlanAnswer(PlanStatus.NO_IK, message=_unreached(reach.reachable), **more))
            else:
                best = reach.found[0]
                more["margins"] = _margins(one.world(), best.joint_pos[None])
                answers.append(PlanAnswer(PlanStatus.OK, chosen=best.chosen, joint_pos=best.joint_pos, **more))
        spent_each = (perf_counter() - begun) / len(asked)
        return [replace(answer, timings={"ik": spent_each}) for answer in answers]

    @property
    def _signature(self) -> str:
        return f"{self.name} {self.version}"

    def search(
        self,
        request: PlanRequest,
        world: PlanningWorld,
        start: Array,
        goal: Array,
        step: float,
        rng: np.random.Generator,
        budget: Budget,
    ) -> Array | None:
        """A path (M, K) between joint positions, free in steps of `step` [rad] or [m]; None if none was found."""
        free = edge_check(world, step)
        path = connect(start, goal, world.lower, world.upper, free, rng, budget)
        return path if path is None else shortened(path, free, rng, budget)

    def _motion(
        self,
        request: PlanRequest,
        scene: Scene,
        world: PlanningWorld,
        goal: GoalConfiguration,
        budget: Budget,
        passed: Any,
    ) -> Trajectory | None:
        start = np.asarray(request.start, dtype=float)
        velocity = np.minimum(world.velocity_limit, 1e3) * request.velocity_scale
        for attempt, (step, blend) in enumerate(ATTEMPTS):
            rng = np.random.default_rng([request.seed, 1 + attempt, *(c + 1 for c in goal.chosen)])
            if request.straight is not None and request.joint_goal is None:
                path, blend = straight_line(self._goals, request, scene, goal.chosen), 1.0  # the points are dense
            else:
                path = self.search(request, world, start, goal.joint_pos, step, rng, budget)
            passed("search")
            if path is None or budget.spent:
                return None
            trajectory = timed(path, velocity, request.acceleration, blend, self.speeds)
            passed("time_law")
            good = _free(world, trajectory.joint_pos)
            passed("check")
            if good:
                return trajectory
        return None


def _first(one: GoalConfiguration) -> int:
    """The candidate of the first tool that counts."""
    return next(c for c in one.chosen if c >= 0)


def _statuses(found: Sequence[GoalConfiguration], width: int) -> list[PlanStatus]:
    free = {_first(one) for one in found}
    return [PlanStatus.OK if g in free else PlanStatus.NO_IK for g in range(width)]


def _unreached(reachable: Array) -> str:
    return f"{int(reachable.sum())} of {len(reachable)} candidates can be reached, all of them in collision"


def _margins(world: PlanningWorld, joint_pos: Array) -> dict[str, float]:
    """How far a path (T, K) stays from the joints' limits, and its end from what it may not touch."""
    limit = float(np.minimum(joint_pos - world.lower, world.upper - joint_pos).min())
    return {"joint_limit": limit, "clearance": world.clearance(joint_pos[-1])}


def _free(world: PlanningWorld, joint_pos: Array) -> bool:
    rows = dense(np.asarray(joint_pos, dtype=float), CHECKED)
    return not any(world.hits(rows[i : i + 64], stop=True).any() for i in range(0, len(rows), 64))
