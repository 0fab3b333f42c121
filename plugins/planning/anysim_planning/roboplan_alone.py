"""Roboplan alone: its own inverse kinematics, search, shortcuts and time law, in its own scene.

A measure of what is built around it, and no planner: nothing checks its paths. Only its scene is made from a World.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION, Array
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.motion import PlanRequest, Scene, ToolGoal
from anysim_planning.goals import GoalSolver, enabled
from anysim_planning.roboplan_scene import GROUP, RoboplanScene, roboplan_module
from anysim_planning.roboplan_text import matrix
from anysim_planning.scene import PlanningWorld
from anysim_planning.search import NODES

STEP = 0.02
"""[rad] or [m] between the configurations that its search and shortcuts look at, as those of `rrt`."""
IK = {"max_iters": 40, "max_restarts": 50, "step_size": 0.5, "max_time": 0.5}
"""Options with which it solves nearly every goal that can be reached; its own are two restarts in 5 ms."""


class BareRoboplan:
    """Roboplan with the scene of one request; others that it is asked have the same joints, limits and tools."""

    def __init__(self, world: World, request: PlanRequest, scene: Scene) -> None:
        """Build its scene.

        Raises:
            PluginError: a part of roboplan is not installed.
        """
        self._core, self._rrt = roboplan_module("core"), roboplan_module("rrt")
        ik, time_law = roboplan_module("simple_ik"), roboplan_module("toppra")
        planned = PlanningWorld(world, request, {})
        planned.take(scene, request.attached)
        made = RoboplanScene(world, planned)
        made.take()
        self._scene, self._names, used = made.scene, list(request.joints), [goal for _, goal in enabled(request)]
        chains = [GoalSolver(world).arm(request, replace(goal, slide=(0.0, 0.0, 0.0))).solver.chain for goal in used]
        self._links = [f"link_{planned.model.getJointId(chain.joint_names[-1])}" for chain in chains]
        self._offsets = [
            _link_in_tool(world, scene, goal, int(chain.joints[-1])) for goal, chain in zip(used, chains, strict=True)
        ]
        self._limit(np.minimum(planned.velocity_limit, 1e3) * request.velocity_scale, request.acceleration)
        self._solver = ik.SimpleIk(
            self._scene,
            ik.SimpleIkOptions(
                group_name=GROUP,
                max_linear_error_norm=used[0].position_tolerance,
                max_angular_error_norm=used[0].rotation_tolerance,
                **IK,
            ),
        )
        self._timing = time_law.PathParameterizerTOPPRA(self._scene, GROUP)
        self._law = time_law.TOPPRAOptions(mode=time_law.SplineFittingMode.Adaptive)

    def plan(self, request: PlanRequest) -> Array | None:
        """Joint positions (T, K) every 0.01 s of a motion to the first candidate that it finds one to, or None."""
        core, goal = self._core, self._core.JointConfiguration()
        start = core.JointConfiguration(self._names, np.asarray(request.start, dtype=float))
        self._solver.setRngSeed(request.seed)
        goals = [one for _, one in enabled(request)]
        for candidate in range(len(goals[0].poses)):
            wanted = [
                core.CartesianConfiguration("link_0", link, matrix(P.compose(one.poses[candidate], offset)))
                for one, link, offset in zip(goals, self._links, self._offsets, strict=True)
            ]
            if self._solver.solveIk(wanted, start, goal) and (way := self._way(request.seed, start, goal)) is not None:
                return way
        return None

    def _way(self, seed: int, start: Any, goal: Any) -> Array | None:
        core = self._core
        options = self._rrt.RRTOptions(
            group_name=GROUP, rrt_connect=True, collision_check_step_size=STEP, max_nodes=NODES
        )
        planner = self._rrt.RRT(self._scene, options)
        planner.setRngSeed(seed)
        try:
            path = planner.plan(start, goal)
        except RuntimeError:  # its way to say that it found none within its bounds
            return None
        shortcuts = core.PathShortcuttingOptions(group_name=GROUP, max_step_size=STEP, seed=seed)
        path = core.PathShortcutter(self._scene, shortcuts).shortcut(path)
        made = self._timing.generate(path, self._law)
        return np.array(made.positions)[:, [list(made.joint_names).index(name) for name in self._names]]

    def _limit(self, velocity: Array, acceleration: float) -> None:
        """The limits that its time law keeps."""
        lines = ["joint_limits:"]
        for name, most in zip(self._names, velocity.tolist(), strict=True):
            lines.append(f"  {name}: {{max_velocity: [{most!r}], max_acceleration: [{acceleration!r}]}}")
        with TemporaryDirectory(prefix="anysim-roboplan-") as folder:
            path = Path(folder) / "limits.yaml"
            path.write_text("\n".join(lines) + "\n", "utf-8")
            self._scene.importJointLimitsFromConfig(self._core.loadJointLimitsConfig(str(path)))


def _link_in_tool(world: World, scene: Scene, goal: ToolGoal, joint: int) -> Array:
    """The pose (7,) of the frame of the joint above a tool, seen from the tool."""
    site = world.sites[next(robot for robot in world.robots if robot.name == goal.robot).tools[goal.tool]]
    tool = P.compose(scene.body_pose[site.body], P.pose(site.position, site.quaternion))
    moved = world.joints[joint]
    frame = P.compose(scene.body_pose[moved.body], P.pose(moved.anchor, IDENTITY_QUATERNION))
    return P.compose(P.inverse(tool), frame)
