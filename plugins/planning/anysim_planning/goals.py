"""Goal sets by inverse kinematics: joint positions that reach candidate poses, free ones only, the nearest first."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice, product
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
from anysim_planning.slides import sliding

DRAWS = 6
"""Starts of a candidate: the live configuration, then random ones as long as what was found collides."""
RESTARTS = 20
TURNS = 24
"""Starts of a candidate of tools that share joints: most are in vain where one tool takes them away from the others."""
COMBINATIONS = 64
"""Choices of several independent tools that are looked at, the nearest first."""


_OF_JOINTS = "joints joint_names prismatic rest anchor axis lower upper velocity_limit initial".split()
"""What a chain has of each joint."""


class Arm(NamedTuple):
    """What moves one tool: its solver, and the request's columns in the order of the solver's joints but for slides."""

    solver: InverseKinematics
    columns: Array


class GoalConfiguration(NamedTuple):
    """Joint positions (K,) for chosen candidates, one of each tool; -1 for a tool that is switched off."""

    chosen: tuple[int, ...]
    joint_pos: Array


class Reach(NamedTuple):
    """Free configurations, the nearest first; which candidates (G,) some configuration reaches, free or not."""

    found: list[GoalConfiguration]
    reachable: Array


class ReachQuery(NamedTuple):
    """A request, its scene, and what gives the collision world with everything where that scene has it."""

    request: PlanRequest
    scene: Scene
    world: Callable[[], PlanningWorld]


class Part(NamedTuple):
    """Some candidates of one tool of a request: the goal's place, the goal, what moves it, and which candidates.

    `base` (n, 7) are the poses of the solver's root, a row for each candidate; None: the one that the scene says.
    """

    request: PlanRequest
    scene: Scene
    tool: int
    goal: ToolGoal
    arm: Arm
    which: Array
    base: Array | None = None


class GoalSolver:
    """Inverse kinematics of all tools of one World."""

    def __init__(self, world: World, solver: str = "numba_ik") -> None:
        self._world, self._solver = world, solver
        self._arms: dict[object, Arm] = {}

    def arm(self, request: PlanRequest, goal: ToolGoal, settled: frozenset[str] = frozenset()) -> Arm:
        """What moves a tool, without the joints that are settled.

        Raises:
            AnysimError: no such robot or tool, or none of the joints moves it.
        """
        key = (request.joints, settled, goal.robot, goal.tool, goal.slide)
        key += (goal.position_tolerance, goal.rotation_tolerance)
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
            joints = [places[name] for name in request.joints if name in places and name not in settled]
            if not joints and settled:
                raise AnysimError(
                    f"the tool '{goal.tool}' hangs from no joint of its own: another tool of the plan has all of them; "
                    f"plan for one of the two"
                )
            if not joints:
                raise AnysimError(f"the tool '{goal.tool}' does not hang from any of the joints of the plan")
            chain = Chain.from_world(world, goal.robot, next(iter(robot.channels)), goal.tool, joints=joints)
            options = {"position_tolerance": goal.position_tolerance, "rotation_tolerance": goal.rotation_tolerance}
            solver = inverse_kinematics(sliding(chain, goal.slide), self._solver, threads=1, **options)
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
        return self.reach_all([ReachQuery(request, scene, lambda: world)])[0]

    def reach_all(self, asked: Sequence[ReachQuery]) -> list[Reach]:
        """Those of several requests, each as if it were alone; candidates of one tool are solved together.

        Raises:
            AnysimError: tools share joints, and choose each for itself, go straight, or have no others.
        """
        searches = [_Search(one, [(t, g, self.arm(one.request, g)) for t, g in enabled(one.request)]) for one in asked]
        for draw in range(DRAWS):
            going = [search for search in searches if search.paired and not search.shared and len(search.open)]
            solved = iter(self._solve([part for search in going for part in search.parts()], draw))
            for search in going:
                search.take(list(islice(solved, len(search.tools))), draw)
        for search in searches:
            if search.shared:
                self._in_turn(search)
        return [search.reach() if search.paired else self._independent(search) for search in searches]

    def _in_turn(self, search: "_Search") -> None:
        """Search for tools that share joints: one moves them, the others reach from there; each leads in its turn."""
        request, scene = search.asked.request, search.asked.scene
        for draw in range(TURNS):
            if not len(search.open):
                return
            order = [search.tools[(draw + k) % len(search.tools)] for k in range(len(search.tools))]
            q = np.tile(np.asarray(request.start, dtype=float), (len(search.open), 1))
            good, led, settled = np.ones(len(q), bool), np.ones(len(q), bool), frozenset[str]()
            for place, (t, goal, whole) in enumerate(order):
                arm = self.arm(request, goal, settled & frozenset(whole.solver.chain.joint_names))
                base = self._base_below(whole, arm, scene, q)
                ((found, ok),) = self._solve([Part(request, scene, t, goal, arm, search.open, base)], draw)
                q[:, arm.columns] = found
                good &= ok
                led &= ok | (place > 0)
                settled |= frozenset(arm.solver.chain.joint_names)
            search.look(q, good)
            if draw < len(search.tools):  # what a tool does not reach with all joints that move it is out of reach
                search.open = search.open[led[search.still]]

    def _base_below(self, whole: Arm, arm: Arm, scene: Scene, joint_pos: Array) -> Array:
        """Poses (n, 7) to give a solver of the last joints of a chain as its root's, the others at (n, K)."""
        chain, above = whole.solver.chain, len(whole.columns) - len(arm.columns)
        base = np.tile(self.base(whole, scene), (len(joint_pos), 1))
        if not above:
            return base
        upper = {name: getattr(chain, name)[:above] for name in _OF_JOINTS}
        first = replace(chain, **upper, tool_offset=chain.rest[above]).tool_pose(
            base, joint_pos[:, whole.columns[:above]]
        )
        return P.compose(first, np.tile(P.inverse(arm.solver.chain.rest[0]), (len(first), 1)))

    def _independent(self, search: "_Search") -> Reach:
        request, scene = search.asked.request, search.asked.scene
        start = np.asarray(request.start, dtype=float)
        options: list[list[tuple[float, int, Array]]] = []
        for t, goal, arm in search.tools:
            rows: list[tuple[float, int, Array]] = []
            for draw in range(2):
                ((q, ok),) = self._solve([Part(request, scene, t, goal, arm, np.arange(len(goal.poses)))], draw)
                cost = np.linalg.norm(q - start[arm.columns], axis=1)
                rows += [(float(cost[g]), int(g), q[g]) for g in np.flatnonzero(ok)]
                if not options:
                    search.reachable |= ok
            options.append(sorted(rows, key=lambda row: row[:2])[:COMBINATIONS])
        some = max(1, int(COMBINATIONS ** (1.0 / len(search.tools))))
        choices = sorted(product(*(rows[:some] for rows in options)), key=lambda c: sum(row[0] for row in c))
        found, world = list[GoalConfiguration](), search.asked.world()
        for choice in choices:
            q, chosen = start.copy(), [-1] * len(request.goals)
            for (t, _, arm), (_, g, part) in zip(search.tools, choice, strict=True):
                q[arm.columns], chosen[t] = part, g
            if not world.hits(q[None])[0]:
                found.append(GoalConfiguration(tuple(chosen), q))
        return Reach(found, search.reachable)

    def _solve(self, parts: Sequence[Part], draw: int) -> list[tuple[Array, Array]]:
        """Positions (n, columns) for the candidates of each part, and which are right (n,)."""
        solved: list[tuple[Array, Array]] = [(np.empty(0), np.empty(0))] * len(parts)
        alike: dict[object, list[int]] = {}
        for number, part in enumerate(parts):
            alike.setdefault((id(part.arm), tuple(part.goal.rotation_weight)), []).append(number)
        for numbers in alike.values():
            rows = [
                _rows(self.base(one.arm, one.scene) if one.base is None else one.base, one, draw)
                for one in (parts[k] for k in numbers)
            ]
            targets, bases, seeds, keys = (np.concatenate(column) for column in zip(*rows, strict=True))
            first = parts[numbers[0]]
            answer = first.arm.solver.solve(
                targets,
                bases,
                seeds,
                random_restarts=RESTARTS,
                rng_seeds=keys,
                rotation_weight=first.goal.rotation_weight,
            )
            joint_pos = answer.joint_pos[:, : len(first.arm.columns)]
            ends = np.cumsum([len(parts[k].which) for k in numbers])[:-1]
            for k, q, good in zip(numbers, np.split(joint_pos, ends), np.split(answer.converged, ends), strict=True):
                solved[k] = q, good
        return solved


class _Search:
    """The candidates of one request while some have no free configuration."""

    def __init__(self, asked: ReachQuery, tools: list[tuple[int, ToolGoal, Arm]]) -> None:
        self.asked, self.tools = asked, tools
        columns = np.concatenate([arm.columns for _, _, arm in tools])
        width = len(tools[0][1].poses)
        self.paired = asked.request.pairing is Pairing.PAIRED or len(tools) == 1
        self.shared = len(set(columns.tolist())) < len(columns)
        if self.shared and not (self.paired and asked.request.straight is None):
            raise AnysimError(
                "tools that share joints choose in pairs and take any path: leave pairing and straight out"
            )
        self.reachable, self.found = np.zeros(width, bool), list[GoalConfiguration]()
        self.open = np.arange(width)
        """Candidates without a free configuration that may still get one."""
        self.still = np.ones(width, bool)
        """Which of those that were open before the last look still are."""

    def parts(self) -> list[Part]:
        """What is to be solved next."""
        return [Part(*self.asked[:2], t, goal, arm, self.open) for t, goal, arm in self.tools]

    def take(self, solved: list[tuple[Array, Array]], draw: int) -> None:
        """Look what of a draw's positions, in the order of the tools, is right and free."""
        request = self.asked.request
        q = np.tile(np.asarray(request.start, dtype=float), (len(self.open), 1))
        good = np.ones(len(self.open), bool)
        for (_, _, arm), (part, ok) in zip(self.tools, solved, strict=True):
            q[:, arm.columns] = part
            good &= ok
        self.look(q, good)
        if draw and not good.any():  # what random starts do not reach either is out of reach
            self.open = self.open[:0]

    def look(self, q: Array, good: Array) -> None:
        """Keep what is free of configurations (n, K) for the open candidates, of which some are good (n,)."""
        self.reachable[self.open[good]] = True
        free = good.copy()
        free[good] = ~self.asked.world().hits(q[good]) if good.any() else False
        for row in np.flatnonzero(free):
            chosen = [-1] * len(self.asked.request.goals)
            for t, _, _ in self.tools:
                chosen[t] = int(self.open[row])
            self.found.append(GoalConfiguration(tuple(chosen), q[row]))
        self.still = ~free
        self.open = self.open[self.still]

    def reach(self) -> Reach:
        """What was found, the nearest first."""
        start = np.asarray(self.asked.request.start)
        self.found.sort(key=lambda one: (float(np.linalg.norm(one.joint_pos - start)), one.chosen))
        return Reach(self.found, self.reachable)


def enabled(request: PlanRequest) -> list[tuple[int, ToolGoal]]:
    """The goals that count, with their places."""
    return [(t, goal) for t, goal in enumerate(request.goals) if goal.enabled]


def _rows(base: Array, part: Part, draw: int) -> tuple[Array, Array, Array, Array]:
    """Targets, bases, seeds and keys of a part's candidates. A row depends on its own key alone."""
    chain, arm = part.arm.solver.chain, part.arm
    keys = [np.random.SeedSequence([part.request.seed, part.tool, int(g), draw]) for g in part.which]
    live = np.zeros(len(chain))
    live[: len(arm.columns)] = np.asarray(part.request.start, dtype=float)[arm.columns]
    live = np.clip(live, chain.lower, chain.upper)
    seeds = np.tile(live, (len(keys), 1))
    if draw:
        low = np.where(np.isfinite(chain.lower), chain.lower, -np.pi)
        high = np.where(np.isfinite(chain.upper), chain.upper, np.pi)
        seeds = np.array([np.random.default_rng(key).uniform(low, high) for key in keys])
    numbers = np.array([key.generate_state(1, np.uint64)[0] for key in keys], dtype=np.uint64)
    targets = np.asarray(part.goal.poses, dtype=float)[part.which]
    return targets, np.array(np.broadcast_to(base, (len(keys), 7))), seeds, numbers
