"""Goal sets by inverse kinematics: joint positions that reach candidate poses, free ones only, the nearest first."""

from itertools import product
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, NameLookupError, listing, suggest
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.world import World
from anysim.planning.api import InverseKinematics, inverse_kinematics
from anysim.planning.motion import Pairing, PlanRequest, Scene, ToolGoal
from anysim_planning.scene import PlanningWorld

DRAWS = 6
"""Starts of a candidate: the live configuration, then random ones as long as what was found collides."""
RESTARTS = 20
COMBINATIONS = 64
"""Choices of several independent tools that are looked at, the nearest first."""


class Arm(NamedTuple):
    """What moves one tool: its solver, and the request's columns in the order of the solver's joints."""

    solver: InverseKinematics
    columns: Array


class Reached(NamedTuple):
    """Joint positions (K,) for chosen candidates, one of each tool; -1 for a tool that is switched off."""

    chosen: tuple[int, ...]
    joint_pos: Array


class Reach(NamedTuple):
    """Free configurations, the nearest first; which candidates (G,) some configuration reaches, free or not."""

    found: list[Reached]
    reachable: Array


class GoalSolver:
    """Inverse kinematics of all tools of one World."""

    def __init__(self, world: World, solver: str = "numba_ik") -> None:
        self._world, self._solver = world, solver
        self._arms: dict[object, Arm] = {}

    def arm(self, request: PlanRequest, goal: ToolGoal) -> Arm:
        """What moves a tool.

        Raises:
            AnysimError: no such robot or tool, or none of the joints moves it.
        """
        key = (request.joints, goal.robot, goal.tool, goal.position_tolerance, goal.rotation_tolerance)
        if key not in self._arms:
            world = self._world
            robot = next((r for r in world.robots if r.name == goal.robot), None)
            if robot is None or goal.tool not in robot.tools:
                known = [f"{r.name}.{tool}" for r in world.robots for tool in r.tools]
                name = f"{goal.robot}.{goal.tool}"
                raise NameLookupError(f"there is no tool '{name}'{suggest(name, known)} (tools: {listing(known)})")
            body, above = world.sites[robot.tools[goal.tool]].body, []
            while body >= 0:
                above.append(world.body_joint[body])
                body = world.bodies[body].parent
            places = {world.joints[j].name: j for j in above if j >= 0}
            joints = [places[name] for name in request.joints if name in places]
            if not joints:
                raise AnysimError(f"the tool '{goal.tool}' does not hang from any of the joints of the plan")
            chain = Chain.from_world(world, goal.robot, next(iter(robot.channels)), goal.tool, joints=joints)
            options = {"position_tolerance": goal.position_tolerance, "rotation_tolerance": goal.rotation_tolerance}
            solver = inverse_kinematics(chain, self._solver, threads=1, **options)
            self._arms[key] = Arm(solver, np.array([request.joints.index(name) for name in chain.joint_names]))
        return self._arms[key]

    def base(self, arm: Arm, scene: Scene) -> Array:
        """The pose (7,) to give a solver as its root's: joints above the first planned one may stand anywhere."""
        chain = arm.solver.chain
        link = self._world.bodies[self._world.joints[chain.joints[0]].body]
        first = P.compose(scene.body_pose[link.parent], P.pose(link.position, link.quaternion))
        return P.compose(first, P.inverse(chain.rest[0]))

    def reach(self, request: PlanRequest, scene: Scene, world: PlanningWorld) -> Reach:
        """Free configurations for a request's goals."""
        used = [(t, goal) for t, goal in enumerate(request.goals) if goal.enabled]
        arms = [self.arm(request, goal) for _, goal in used]
        columns = np.concatenate([arm.columns for arm in arms])
        if len(set(columns.tolist())) < len(columns):
            raise AnysimError("two tools that share a joint cannot be planned together yet: plan one after the other")
        width = len(used[0][1].poses)
        reachable, found = np.zeros(width, bool), list[Reached]()
        open_ = np.arange(width)  # candidates without a free configuration
        paired = request.pairing is Pairing.PAIRED or len(used) == 1
        if not paired:
            return self._independent(request, scene, world, used, arms)
        for draw in range(DRAWS):
            q = np.tile(np.asarray(request.start, dtype=float), (len(open_), 1))
            good = np.ones(len(open_), bool)
            for (t, goal), arm in zip(used, arms, strict=True):
                q[:, arm.columns], ok = self._solve(request, goal, arm, scene, t, open_, draw)
                good &= ok
            reachable[open_[good]] = True
            free = good.copy()
            free[good] = ~world.hits(q[good]) if good.any() else False
            for row in np.flatnonzero(free):
                chosen = [-1] * len(request.goals)
                for t, _ in used:
                    chosen[t] = int(open_[row])
                found.append(Reached(tuple(chosen), q[row]))
            open_ = open_[~free]
            if not len(open_) or (draw and not good.any()):  # what random starts do not reach either is out of reach
                break
        start = np.asarray(request.start)
        found.sort(key=lambda one: (float(np.linalg.norm(one.joint_pos - start)), one.chosen))
        return Reach(found, reachable)

    def _independent(
        self,
        request: PlanRequest,
        scene: Scene,
        world: PlanningWorld,
        used: list[tuple[int, ToolGoal]],
        arms: list[Arm],
    ) -> Reach:
        start = np.asarray(request.start, dtype=float)
        options: list[list[tuple[float, int, Array]]] = []
        reachable = np.zeros(len(used[0][1].poses), bool)
        for (t, goal), arm in zip(used, arms, strict=True):
            rows: list[tuple[float, int, Array]] = []
            for draw in range(2):
                q, ok = self._solve(request, goal, arm, scene, t, np.arange(len(goal.poses)), draw)
                cost = np.linalg.norm(q - start[arm.columns], axis=1)
                rows += [(float(cost[g]), int(g), q[g]) for g in np.flatnonzero(ok)]
                if not options:
                    reachable |= ok
            options.append(sorted(rows, key=lambda row: row[:2])[:COMBINATIONS])
        some = max(1, int(COMBINATIONS ** (1.0 / len(used))))
        choices = sorted(product(*(rows[:some] for rows in options)), key=lambda c: sum(row[0] for row in c))
        found: list[Reached] = []
        for choice in choices:
            q, chosen = start.copy(), [-1] * len(request.goals)
            for (t, _), arm, (_, g, part) in zip(used, arms, choice, strict=True):
                q[arm.columns], chosen[t] = part, g
            if not world.hits(q[None])[0]:
                found.append(Reached(tuple(chosen), q))
        return Reach(found, reachable)

    def _solve(
        self, request: PlanRequest, goal: ToolGoal, arm: Arm, scene: Scene, tool: int, which: Array, draw: int
    ) -> tuple[Array, Array]:
        """Positions (n, columns) for some candidates, and which are right (n,). A row depends on its own key alone."""
        chain, keys = arm.solver.chain, [np.random.SeedSequence([request.seed, tool, int(g), draw]) for g in which]
        live = np.clip(np.asarray(request.start, dtype=float)[arm.columns], chain.lower, chain.upper)
        seeds = np.tile(live, (len(which), 1))
        if draw:
            low = np.where(np.isfinite(chain.lower), chain.lower, -np.pi)
            high = np.where(np.isfinite(chain.upper), chain.upper, np.pi)
            seeds = np.array([np.random.default_rng(key).uniform(low, high) for key in keys])
        base = np.tile(self.base(arm, scene), (len(which), 1))
        rng_seeds = np.array([key.generate_state(1, np.uint64)[0] for key in keys], dtype=np.uint64)
        targets = np.asarray(goal.poses, dtype=float)[which]
        weight = goal.rotation_weight
        answer = arm.solver.solve(
            targets, base, seeds, random_restarts=RESTARTS, rng_seeds=rng_seeds, rotation_weight=weight
        )
        return answer.joint_pos, answer.converged
