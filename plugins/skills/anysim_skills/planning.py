"""Planners of an env: one service and one collision check for all of its arms, closed with the env."""

import os
from typing import Annotated, Literal

from pydantic import Field

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.model.world import World
from anysim.planning.motion import Scenes, motion_planner
from anysim.planning.service import planner_service
from anysim.task.env import TaskEnv
from anysim_skills.env_lifetime import PerEnv

WORKERS_VARIABLE = "ANYSIM_PLANNER_WORKERS"
"""The environment variable that says how many workers plan; no result depends on it."""

PlannerName = Annotated[str, Field(description="plans moves around obstacles, such as rrt; empty: straight lines")]
Latency = Annotated[
    Annotated[int, Field(ge=1)] | Literal["realtime"],
    Field(description="control steps from a question to the planner until its answer, or once it is ready"),
]
REALTIME = "realtime"
"""Plans take effect as soon as they are ready: no two runs need be the same."""
LATENCY = 5
"""Control steps."""


class EnvPlanner:
    """A planner for all arms of one env.

    Attributes:
        name, version: of the planner.
        checker: for checks in the thread of the control loop.
        service: for plans beside it.
    """

    def __init__(self, world: World, name: str, workers: int) -> None:
        self._world, self.name = world, name
        self.checker = motion_planner(world, name)
        self.version = self.checker.version
        self.service = planner_service(world, name, workers)

    def scenes(self, body_pose: Array, present: Array) -> Scenes:
        """One env as it is now, with poses (B, 7) and presence (E,), and what tells whether it has changed since.

        Each question has its own, so that what counts as a change depends on nothing that was asked before.
        """
        scenes = Scenes(self._world, 1)
        scenes.update(body_pose[None], present[None])
        return scenes


_PLANNERS: PerEnv[str, EnvPlanner] = PerEnv(lambda made: made.service.close())


def planner_of(env: TaskEnv, name: str) -> EnvPlanner:
    """The planner of an env by name, shared by its arms.

    Raises:
        PluginError: no planner of motion of that name is installed.
        TaskError: the number of workers in the environment variable is none.
    """
    return _PLANNERS.of(env, name, lambda: EnvPlanner(env.engine.world, name, _workers()))


def _workers() -> int:
    text = os.environ.get(WORKERS_VARIABLE, "1")
    if not text.isdecimal() or int(text) < 1:
        raise TaskError(f"{WORKERS_VARIABLE} is '{text}'; expected a number of workers of at least 1, such as 2")
    return int(text)
