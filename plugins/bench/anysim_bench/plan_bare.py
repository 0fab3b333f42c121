"""Requests planned by roboplan alone, with nothing of anysim between it and them but the poses that it is asked for."""

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, cast

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError
from anysim.model.world import World
from anysim.planning.motion import PlanRequest, Scene, motion_planner


class BarePlanner(Protocol):
    """Roboplan itself."""

    def plan(self, request: PlanRequest) -> Array | None:
        """Joint positions (T, K) of a motion."""
        ...


class BareCost(NamedTuple):
    """Roboplan alone on the same requests: inverse kinematics, search, shortcuts and time law, and no check of a path.

    Attributes:
        rate: plans a second.
        cpu_ms: processor time of a plan.
        solved, free: shares of the requests, and of the paths found.
        length: [rad] mean length of a path.
    """

    rate: float
    cpu_ms: float
    solved: float
    free: float
    length: float


class BareTurns:
    """Roboplan in turns with others; the best turn counts."""

    def __init__(self, alone: BarePlanner, asked: Sequence[PlanRequest]) -> None:
        self._alone, self._asked = alone, asked
        self._wall = self._cpu = np.inf
        self._paths: list[Array] = []

    def turn(self) -> None:
        """Plan all requests once."""
        begun, processor = time.perf_counter(), time.process_time()
        paths = [self._alone.plan(request) for request in self._asked]
        self._wall = min(self._wall, time.perf_counter() - begun)
        self._cpu = min(self._cpu, time.process_time() - processor)
        self._paths = [path for path in paths if path is not None]

    def cost(self, is_free: Callable[[Array], bool]) -> BareCost:
        """What came of it."""
        count = len(self._asked)
        return BareCost(
            count / self._wall,
            1e3 * self._cpu / count,
            len(self._paths) / count,
            float(np.mean([is_free(path) for path in self._paths] or [0.0])),
            float(np.mean([length(path) for path in self._paths] or [0.0])),
        )


def bare(world: World, asked: Sequence[PlanRequest], scene: Scene) -> BareTurns | None:
    """Roboplan with a scene; None where it is not installed."""
    try:
        planner = motion_planner(world, "roboplan")
        make = cast(Callable[[PlanRequest, Scene], BarePlanner], getattr(planner, "alone"))  # noqa: B009  (of that planner alone)
        return BareTurns(make(asked[0], scene), asked)
    except PluginError:
        return None


def length(path: Array) -> float:
    """[rad] of a path (T, K)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
