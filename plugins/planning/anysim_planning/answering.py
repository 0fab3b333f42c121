"""A planner that answers requests for a service, one after the other, whatever one of them does to it."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from time import thread_time
from typing import NamedTuple

from anysim import registry
from anysim.model.world import World
from anysim.planning.motion import Budget, MotionPlanner, PlanAnswer, PlanRequest, PlanStatus, Scene, motion_planner

IK = "ik"
"""The capability of planners that answer requests without a path."""
PlannerMaker = Callable[[], MotionPlanner]


class Job(NamedTuple):
    """A request with all that its planner needs."""

    request: PlanRequest
    scene: Scene
    budget: Budget


def planner_maker(world: World, planner: str | PlannerMaker) -> PlannerMaker:
    """What makes the planner of a name, or what was given.

    Raises:
        PluginError: there is no planner of that name.
    """
    if not isinstance(planner, str):
        return planner
    registry.entry("planners", planner)  # the name of none is an error here, not in a worker
    return partial(motion_planner, world, planner)


class PlannerHost:
    """A planner of one thread. Where it cannot be made, requests fail, and the next ones try again."""

    def __init__(self, make: PlannerMaker) -> None:
        self._make, self._planner = make, None

    def answers(self, jobs: Sequence[Job]) -> Iterator[tuple[PlanAnswer, float]]:
        """Answers in order, each as soon as it is there with its processor time [s]; what breaks one fails it alone."""
        begun = thread_time()
        for answer in self._answers(jobs):
            yield answer, thread_time() - begun
            begun = thread_time()

    def _answers(self, jobs: Sequence[Job]) -> Iterator[PlanAnswer]:
        try:
            self.prepare()
        except BaseException as error:  # noqa: BLE001  (a stranger's code must not end the worker)
            yield from (_failure(error) for _ in jobs)
        else:
            yield from self._together(jobs) or map(self._alone, jobs)

    def prepare(self) -> MotionPlanner:
        """The planner, made where it is not yet; raises whatever its maker does."""
        if self._planner is None:
            self._planner = self._make()
        return self._planner

    def _together(self, jobs: Sequence[Job]) -> list[PlanAnswer] | None:
        """Answers of a planner that saves time by seeing all requests; None where it does not, or broke."""
        planner = self.prepare()
        kinds = {job.request.kind for job in jobs}
        if len(jobs) < 2 or type(planner).plan_all is MotionPlanner.plan_all or not kinds <= planner.fused:
            return None
        if any(_undeclared(planner, job.request) for job in jobs):
            return None
        try:
            for job in jobs:
                planner.warm_up(job.request, job.scene)
            requests, scenes, budgets = zip(*jobs, strict=True)
            answers = planner.plan_all(requests, scenes, budgets)
        except BaseException:  # noqa: BLE001  (as above: each is tried alone)
            return None
        missing = PlanAnswer(PlanStatus.FAILED, message="the planner gave no answer")
        return [*answers, *[missing] * len(jobs)][: len(jobs)]

    def _alone(self, job: Job) -> PlanAnswer:
        try:
            planner = self.prepare()
            if missing := _undeclared(planner, job.request):
                return PlanAnswer(PlanStatus.FAILED, message=missing)
            planner.warm_up(job.request, job.scene)
            job.budget.begin()
            return planner.plan(*job)
        except BaseException as error:  # noqa: BLE001  (as above)
            return _failure(error)


def _undeclared(planner: MotionPlanner, request: PlanRequest) -> str:
    """Why a planner is not asked for a request of this kind; empty where it is."""
    if request.path or IK in planner.capabilities:
        return ""
    return f"the planner '{planner.name}' does not declare '{IK}': it answers motions alone; ask 'rrt' or 'roboplan'"


def _failure(error: BaseException) -> PlanAnswer:
    return PlanAnswer(PlanStatus.FAILED, message=f"the planner raised {type(error).__name__}: {error}")
