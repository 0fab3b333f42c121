"""The planner `rrt` with a fault where the cube of `behind_wall.yaml` lies far to the side, in any process."""

import os
import signal
import time
from functools import cache
from pathlib import Path

from anysim import compile_world
from anysim.model.world import World
from anysim.planning.motion import Budget, PlanAnswer, PlanRequest, Scene
from anysim_planning.rrt import RrtPlanner

WALL = Path(__file__).parent / "worlds/behind_wall.yaml"
FAULT, BEYOND = "ANYSIM_TEST_FAULT", "ANYSIM_TEST_BEYOND"
"""Environment variables: what happens, and for cubes at larger y [m] than this."""


class FaultyPlanner(RrtPlanner):
    """Raises, hangs, ends its process or is slow for some scenes."""

    def plan(self, request: PlanRequest, scene: Scene, budget: Budget) -> PlanAnswer:
        cube = self.world.entities[self.world.entity_numbers["cube"]].root
        if scene.body_pose[cube, 1] > float(os.environ[BEYOND]):
            match os.environ[FAULT]:
                case "raises":
                    raise ZeroDivisionError
                case "hangs":
                    time.sleep(2.5)
                case "dies":
                    os.kill(os.getpid(), signal.SIGKILL)
                case "is slow":
                    time.sleep(0.2)
        return super().plan(request, scene, budget)


def faulty() -> FaultyPlanner:
    """What services make their planners with."""
    return FaultyPlanner(_world())


@cache
def _world() -> World:
    return compile_world(WALL)
