"""A planner of motion: straight to the goal, or over one posture between."""

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.model.world import World
from anysim.planning.motion import Budget, MotionPlanner, PlanAnswer, PlanRequest, PlanStatus, Scene
from anysim_planning.goals import GoalConfiguration, GoalSolver
from anysim_planning.scene import PlanningWorld, topology
from anysim_planning.search import dense, edge_check
from anysim_planning.time_law import timed

STEP = 0.005


class HopPlanner(MotionPlanner):
    """Random postures are tried in turn, until the ways to one and on from it are free."""

    name = "starter_hop"
    version = "1"
    capabilities = frozenset({"attached", "independent", "joint_goal", "paired"})

    def __init__(self, world: World, tries: int = 2000) -> None:
        """`tries`: postures, after which there is no path."""
        super().__init__(world)
        self._tries, self._goals = tries, GoalSolver(world)
        self._checks: dict[object, PlanningWorld] = {}
        self._shapes: dict[object, object] = {}

    def plan(self, request: PlanRequest, scene: Scene, budget: Budget) -> PlanAnswer:
        """Goals, a path to one of them, its times, and a last look at it."""
        request.check()
        if request.straight is not None:
            raise AnysimError("the planner 'starter_hop' has no straight lines; ask 'rrt' for one")
        checks, start = self._world(request, scene), np.asarray(request.start, dtype=float)
        width = next((len(goal.poses) for goal in request.goals if goal.enabled), 1)

        def answer(
            status: PlanStatus, message: str = "", found: GoalConfiguration | None = None, **more: object
        ) -> PlanAnswer:
            chosen = () if found is None else found.chosen
            each = [PlanStatus.NO_IK if found else status] * width
            for one in goals if found else ():
                each[next(c for c in one.chosen if c >= 0)] = PlanStatus.OK
            who = f"{self.name} {self.version}"
            return PlanAnswer(
                status, tuple(each), chosen, solver=who, world_version=scene.version, message=message, **more
            )

        if checks.hits(start[None])[0]:
            return answer(PlanStatus.START_IN_COLLISION, f"the start touches: {checks.touching(start)[:4]}")
        goals = self._reached(request, scene, checks)
        if not goals:
            return answer(PlanStatus.NO_IK, f"none of {width} goals can be reached without a collision")
        rng = np.random.default_rng(request.seed)
        path = self._path(start, goals[0].joint_pos, checks, rng, budget)
        if budget.spent:
            return answer(budget.spent, "it was stopped before a path was found")
        if path is None:
            return answer(PlanStatus.NO_PATH, f"none of {self._tries} postures lies between start and goal")
        velocity = checks.velocity_limit * request.velocity_scale
        trajectory = timed(path, velocity, request.acceleration, 0.0)  # it rests at the posture between
        return answer(PlanStatus.OK, found=goals[0], trajectory=trajectory)

    def is_free(self, request: PlanRequest, scene: Scene, joint_pos: Array) -> bool:
        """Whether a path is free, 0.005 rad by 0.005 rad."""
        return not self._world(request, scene).hits(dense(np.asarray(joint_pos), STEP)).any()

    def _world(self, request: PlanRequest, scene: Scene) -> PlanningWorld:
        """The collision checks of a request: they are made once for requests alike, and take over each scene."""
        key = topology(request)
        if key not in self._checks:
            self._checks = {key: PlanningWorld(self.world, request, self._shapes)}
        self._checks[key].take(scene, request.attached)
        return self._checks[key]

    def _reached(self, request: PlanRequest, scene: Scene, checks: PlanningWorld) -> list[GoalConfiguration]:
        """Free joint positions of goals, the nearest first."""
        if request.joint_goal is None:
            return self._goals.reach(request, scene, checks).found
        goal = np.asarray(request.joint_goal, dtype=float)
        inside = (goal >= checks.lower).all() and (goal <= checks.upper).all()
        return [GoalConfiguration((0,), goal)] if inside and not checks.hits(goal[None])[0] else []

    def _path(
        self, start: Array, goal: Array, checks: PlanningWorld, rng: np.random.Generator, budget: Budget
    ) -> Array | None:
        free = edge_check(checks, STEP)
        if free(start, goal):
            return np.stack([start, goal])
        for _ in range(self._tries):
            if budget.spent:
                return None
            between = rng.uniform(checks.lower, checks.upper)
            if free(start, between) and free(between, goal):
                return np.stack([start, between, goal])
        return None
