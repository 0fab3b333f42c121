"""The planner of motion `roboplan`: as `rrt`, with roboplan's search and shortcuts where no straight path is free.

Goals, lines, time laws and the last check are those of `rrt`: roboplan's own inverse kinematics misses goals, and its
time laws leave the acceleration limits. Its search does not hold the GIL.
"""

from collections import OrderedDict
from importlib.metadata import PackageNotFoundError, version
from time import perf_counter

import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim.planning.motion import Budget, PlanAnswer, PlanRequest, Scene
from anysim_planning.roboplan_alone import BareRoboplan
from anysim_planning.roboplan_scene import GROUP, RoboplanScene, probe, roboplan_module
from anysim_planning.rrt import KEPT, RrtPlanner
from anysim_planning.scene import PlanningWorld
from anysim_planning.search import NODES, REACH, edge_check

COARSE = 2.5
"""Steps of the search, in those of the shortcuts."""


def _installed() -> str:
    try:
        return version("roboplan-rrt")
    except PackageNotFoundError:
        return "absent"


class RoboplanPlanner(RrtPlanner):
    """RRT-Connect of roboplan 0.7 on the planning world of `rrt`.

    A cancelled search of roboplan ends at its own bounds: nodes, and the deadline.
    """

    name = "roboplan"
    version = f"1 (roboplan {_installed()})"

    def __init__(self, world: World, solver: str = "numba_ik") -> None:
        """`solver`: of inverse kinematics, by name.

        Raises:
            PluginError: roboplan is not installed, or places attached geometry differently than this adapter expects.
        """
        super().__init__(world, solver)
        probe()
        self._rrt = roboplan_module("rrt")
        self._scenes: OrderedDict[PlanningWorld, RoboplanScene] = OrderedDict()
        self._begun = 0.0

    def plan(self, request: PlanRequest, scene: Scene, budget: Budget) -> PlanAnswer:
        """Search."""
        self._begun = perf_counter()
        return super().plan(request, scene, budget)

    def alone(self, request: PlanRequest, scene: Scene) -> BareRoboplan:
        """Roboplan itself with this scene, to be compared with what is built around it.

        Raises:
            PluginError: a part of roboplan that the planner does without is not installed.
        """
        return BareRoboplan(self.world, request, scene)

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
        """A path (M, K): the straight one if it is free, else one by roboplan.

        Where roboplan's coarser shapes, or its limits, do not let it begin or end, it is searched as `rrt` does.
        """
        if edge_check(world, step)(start, goal):
            return np.stack([start, goal])
        left = request.deadline - (perf_counter() - self._begun)
        if budget.spent or left <= 0:
            return None
        scene = self._scene(world).scene
        core, names = roboplan_module("core"), list(request.joints)
        columns = [names.index(name) for name in scene.getJointNames()]
        if not all(
            scene.isValidConfiguration(q[columns]) and not scene.hasCollisions(q[columns]) for q in (start, goal)
        ):
            return super().search(request, world, start, goal, step, rng, budget)
        options = self._rrt.RRTOptions(
            group_name=GROUP,
            rrt_connect=True,
            max_connection_distance=REACH,
            collision_check_step_size=COARSE * step,
            max_nodes=NODES,
            max_planning_time=left,
        )
        planner = self._rrt.RRT(scene, options)
        planner.setRngSeed(int(rng.integers(2**31)))
        try:
            path = planner.plan(core.JointConfiguration(names, start), core.JointConfiguration(names, goal))
        except RuntimeError:  # its way to say that it found none within its bounds
            return None
        if budget.spent:
            return None
        shortcuts = core.PathShortcuttingOptions(
            group_name=GROUP, max_step_size=step, max_convergence_iters=5, seed=int(rng.integers(2**31))
        )
        path = core.PathShortcutter(scene, shortcuts).shortcut(path)
        rows = np.array(path.positions)[:, [list(path.joint_names).index(name) for name in names]]
        rows[0], rows[-1] = start, goal
        return rows

    def _scene(self, world: PlanningWorld) -> RoboplanScene:
        if world not in self._scenes:
            self._scenes[world] = RoboplanScene(self.world, world)
            if len(self._scenes) > KEPT:
                self._scenes.popitem(last=False)
        self._scenes.move_to_end(world)
        self._scenes[world].take()
        return self._scenes[world]
