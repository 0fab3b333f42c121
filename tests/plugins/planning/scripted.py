"""A planner that does what requests tell it to, here and in other processes."""

import os
import signal
import time

import numpy as np

from anysim.model.world import World
from anysim.planning.motion import Budget, MotionPlanner, PlanAnswer, PlanRequest, PlanStatus, Scene, Trajectory

RAISES, EXITS, HANGS, SLEEPS, DIES, LOADS, ASKS = range(100, 107)
"""Seeds; all others are answered at once."""


class Scripted(MotionPlanner):
    """Answers with the seed of a request."""

    name, version, capabilities = "scripted", "1", frozenset({"joint_goal"})

    def __init__(self) -> None:
        super().__init__(World())

    def warm_up(self, request: PlanRequest, scene: Scene) -> None:
        if request.seed == LOADS:
            time.sleep(0.3)

    def plan(self, request: PlanRequest, scene: Scene, budget: Budget) -> PlanAnswer:
        match request.seed:
            case 100:
                raise ValueError("broken")
            case 101:
                raise SystemExit(3)
            case 102:
                time.sleep(1.5)
            case 103:
                time.sleep(0.05)
            case 104:
                os.kill(os.getpid(), signal.SIGKILL)
            case 106:  # until it is told to stop
                while not budget.spent:
                    time.sleep(0.001)
        if budget.spent:
            return PlanAnswer(budget.spent)
        path = np.full((1, len(request.joints)), float(request.seed))
        return PlanAnswer(PlanStatus.OK, trajectory=Trajectory(np.zeros(1), path, path), world_version=scene.version)

    def is_free(self, request: PlanRequest, scene: Scene, joint_pos: np.ndarray) -> bool:
        return True


class Together(Scripted):
    """Answers all requests of a batch at once; 100 breaks the whole batch."""

    def plan_all(self, requests, scenes, budgets) -> list[PlanAnswer]:
        return super().plan_all(requests, scenes, budgets)


def broken() -> MotionPlanner:
    raise RuntimeError("no such file")


def asked(seed: int = 0, joints: int = 1, deadline: float = 5.0) -> PlanRequest:
    names = tuple(f"j{k}" for k in range(joints))
    return PlanRequest(names, np.zeros(joints), joint_goal=np.ones(joints), seed=seed, deadline=deadline)


SCENE = Scene(3, np.zeros((0, 7)), np.zeros(0, bool))
