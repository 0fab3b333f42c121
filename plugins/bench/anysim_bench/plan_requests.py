"""Requests that have an answer: from drawn free configurations to the tool poses of others."""

from itertools import combinations

import numpy as np

from anysim.conventions import Array
from anysim.errors import EngineError
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import World
from anysim.planning.motion import MotionPlanner, PlanRequest, Scene, ToolGoal

SEED = 20_000
DEADLINE = 60.0
"""[s] so long that counts bound the search, and not a busy machine."""


class Arms:
    """Tools of a World's first robot with joints of their own, and free configurations of those joints.

    Attributes:
        tools: the joints (indices) that move each tool and none of the others, from the root on.
        joints: names of all of them.
    """

    def __init__(self, world: World, planner: MotionPlanner, count: int) -> None:
        """`count`: of tools, 1 or 2.

        Raises:
            EngineError: the first robot does not have as many tools that move apart.
        """
        self._world, self._planner = world, planner
        above = {tool: _above(world, site) for tool, site in world.robots[0].tools.items()} if world.robots else {}
        for names in combinations(above, count):
            own = {
                tool: [j for j in above[tool] if all(j not in above[b] for b in names if b != tool)] for tool in names
            }
            if all(own.values()):
                break
        else:
            raise EngineError(f"the world's first robot has no {count} tools that joints of their own move")
        self.robot, self.tools = world.robots[0].name, own
        self._columns = np.array([j for joints in own.values() for j in joints])
        self.joints = tuple(world.joints[j].name for j in self._columns)

    def free(self, scene: Scene, count: int) -> Array:
        """(count, K) free configurations, drawn within the limits."""
        picked = [self._world.joints[j] for j in self._columns]
        low = np.array([max(joint.lower, -np.pi) for joint in picked])
        high = np.array([min(joint.upper, np.pi) for joint in picked])
        rng, found = np.random.default_rng(SEED), list[Array]()
        while len(found) < count:
            q = rng.uniform(low, high)
            if self._planner.is_free(PlanRequest(self.joints, q, joint_goal=q), scene, q[None]):
                found.append(q)
        return np.array(found)

    def bodies(self, scene: Scene, joint_pos: Array, others: Array) -> Array:
        """(n, B, 7) world poses of all bodies for configurations (n, K); `others` (J,) where all other joints are."""
        positions = np.tile(others, (len(joint_pos), 1))
        positions[:, self._columns] = joint_pos
        return forward_kinematics(self._world, np.tile(scene.body_pose, (len(joint_pos), 1, 1)), positions)

    def requests(self, scene: Scene, others: Array, count: int, goals: int) -> list[PlanRequest]:
        """From one free configuration to the tool poses of the next ones: `goals` candidates of each tool, in pairs."""
        free = self.free(scene, count + goals)
        bodies, poses = self.bodies(scene, free, others), dict[str, Array]()
        for tool in self.tools:
            site = self._world.sites[self._world.robots[0].tools[tool]]
            poses[tool] = P.compose(bodies[:, site.body], P.pose(site.position, site.quaternion))
        return [
            PlanRequest(
                self.joints,
                free[i],
                tuple(ToolGoal(self.robot, tool, rows[i + 1 : i + 1 + goals]) for tool, rows in poses.items()),
                seed=i,
                deadline=DEADLINE,
            )
            for i in range(count)
        ]


def _above(world: World, site: int) -> list[int]:
    """The joints between the root and a site, but for those that follow others."""
    body, joints = world.sites[site].body, list[int]()
    while body >= 0:
        j = world.body_joint[body]
        if j >= 0 and world.joints[j].mimic is None:
            joints.insert(0, j)
        body = world.bodies[body].parent
    return joints
