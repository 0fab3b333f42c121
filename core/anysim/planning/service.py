"""Plans made beside the simulation: submit, keep stepping, harvest.

When an answer takes effect is part of the question: after `latency` control steps, for which the loop waits if need be;
or as soon as it is ready (`latency=None`), which gives up reproducibility.
"""

import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Self, cast

from anysim import registry
from anysim.errors import PluginError
from anysim.model.world import World
from anysim.planning.motion import Budget, PlanAnswer, PlanRequest, Scene

SERVICE_VARIABLE = "ANYSIM_PLANNER_SERVICE"
"""The environment variable that names the default service; no result depends on it."""


class PlanFuture:
    """An answer to come. `due` is the control step at which it takes effect, None for as soon as it is ready."""

    def __init__(
        self, service: "PlannerService", request: PlanRequest, scene: Scene, env: int | None, due: int | None
    ) -> None:
        self.request, self.scene, self.env, self.due = request, scene, env, due
        self.budget = Budget(request.deadline)
        self.answer: PlanAnswer | None = None
        self._service = service

    @property
    def done(self) -> bool:
        """Whether the answer is there."""
        return self.answer is not None

    def result(self) -> PlanAnswer:
        """The answer; waits for it."""
        return self._service.wait(self)

    def cancel(self) -> bool:
        """Give it up; False if its answer has been there before."""
        return self._service.cancel(self)


@dataclass
class ServiceCounts:
    """Of all requests so far; `late` were waited for, for `waited` [s] in all; `lost_workers` hung or died.

    `answered` has the cancelled ones in it. `processor` [s] is what planners computed, where they answered.
    """

    submitted: int = 0
    answered: int = 0
    cancelled: int = 0
    late: int = 0
    waited: float = 0.0
    lost_workers: int = 0
    processor: float = 0.0

    @property
    def queue(self) -> int:
        """How many wait for their answers."""
        return self.submitted - self.answered


class PlannerService(ABC):
    """Workers that answer requests. Use it as a context manager, or call `close`; one thread calls it.

    Attributes:
        beside: whether its workers are processes of their own, whose processor time this one's has not in it.
    """

    beside: ClassVar[bool] = False

    def __init__(self) -> None:
        self.counts = ServiceCounts()

    @abstractmethod
    def submit(
        self, request: PlanRequest, scene: Scene, *, env: int | None = None, now: int = 0, latency: int | None = 0
    ) -> PlanFuture:
        """Ask for a plan at control step `now`; it begins with the next `flush`, `harvest` or `result`.

        Until then a newer request of the same `env` and joints supersedes it: it ends `cancelled`. None: none does.

        Raises:
            AnysimError: the request is malformed; nothing was submitted. Or the service is closed.
        """

    @abstractmethod
    def flush(self) -> None:
        """Hand the requests of this tick to the workers, similar ones together."""

    @abstractmethod
    def harvest(self, now: int) -> list[PlanFuture]:
        """The futures that take effect at control step `now`, in the order of their submission; waits for late ones."""

    @abstractmethod
    def wait(self, future: PlanFuture) -> PlanAnswer:
        """The answer of a future of this service."""

    @abstractmethod
    def cancel(self, future: PlanFuture) -> bool:
        """Answer `cancelled`, and ask its planner to stop; False if it has been answered."""

    @abstractmethod
    def close(self) -> None:
        """Cancel what is under way and end the workers."""

    def __enter__(self) -> Self:
        """The service itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


def default_service() -> str:
    """`ANYSIM_PLANNER_SERVICE` if set, else planners in processes, where there are any."""
    return os.environ.get(SERVICE_VARIABLE) or ("threads" if sys.platform == "win32" else "processes")


def planner_service(world: World, planner: str = "rrt", workers: int = 1, service: str | None = None) -> PlannerService:
    """A service whose workers plan with the named planner; answers are the same bits whichever it is.

    Of the services of anysim-planning, `processes` leaves the control loop alone, but takes a second or two to start;
    `threads` is ready at once and holds up the loop while it plans. None: the default one.

    Raises:
        PluginError: no planner or service of that name is installed, or it is something else.
    """
    name = service or default_service()
    made = registry.load("planners", name)
    if not (isinstance(made, type) and issubclass(made, PlannerService)):
        raise PluginError(f"'{name}' is a planner and no service; try 'processes' or 'threads'")
    maker = cast(Callable[..., PlannerService], made)
    with registry.using("planners", name, (TypeError,)):
        return maker(world, planner, workers)
