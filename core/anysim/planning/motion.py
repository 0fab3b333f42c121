"""Motion plans as skills ask for them: requests, the scene they are planned in, answers, and planners found by name.

An answer depends on the request and on the scene that came with it alone: not on what was planned before or beside it,
nor on the number of threads. A deadline is a net under a search that is bounded by its own counts; the one answer that
may differ between two machines is `timeout`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from threading import Event
from time import perf_counter
from typing import ClassVar, NamedTuple

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import AnysimError, PluginError
from anysim.model.world import EntityKind, World
from anysim.planning.api import ALL_AXES


class PlanStatus(StrEnum):
    """How a plan, or one candidate of a goal set, ended; `failed` says that the planner itself broke."""

    OK = "ok"
    NO_IK = "no_ik"
    START_IN_COLLISION = "start_in_collision"
    NO_PATH = "no_path"
    TIMEOUT = "timeout"
    CANCELLED = "cancelled"
    FAILED = "failed"


class RequestKind(StrEnum):
    """What is asked for, by how many tools: joint positions at a goal, or a motion to it."""

    IK = "ik"
    DUAL_IK = "dual_ik"
    MOTION = "motion"
    DUAL_MOTION = "dual_motion"


class Pairing(StrEnum):
    """How several tools choose: all the same candidate, or each its own."""

    PAIRED = "paired"
    INDEPENDENT = "independent"


@dataclass(frozen=True, eq=False)
class ToolGoal:
    """A goal set of one tool.

    Attributes:
        robot, tool: names; the tool moves by those of the request's joints that lie between the root and it.
        poses: (G, 7) candidates, world poses of the tool.
        rotation_weight: (3,) about the tool's axes; 0 leaves that rotation free.
        position_tolerance: [m]
        rotation_tolerance: [rad]
        enabled: one that is not counts for nothing, but keeps its place.
        slide: (3,) [m] by how much the tool may be off along each of its axes; at the end of a `straight` it is not.
    """

    robot: str
    tool: str
    poses: Array
    rotation_weight: tuple[float, float, float] = ALL_AXES
    position_tolerance: float = 1e-4
    rotation_tolerance: float = 1e-4
    enabled: bool = True
    slide: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Attachment(NamedTuple):
    """A held object: it moves with a body. `offset` (7,) is the measured pose of the object's root in that body."""

    entity: str
    body: str
    offset: Array


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """A motion that is wanted: to the poses of tools, or to joint positions.

    Attributes:
        joints: (K) names of the World's joints that may move; all others stay as the scene has them. A base is free if
            its joints are among them, else locked.
        start: (K,) where the motion begins.
        goals: one or several tools, or none with a `joint_goal`.
        pairing: how several tools choose among their candidates.
        joint_goal: (K,)
        path: False asks for joint positions at the goals alone (`ik`, `dual_ik`): free ones, the nearest to `start`,
            which may itself be in collision then.
        straight: [m] how far the tools may leave the straight line to their pose; None for any path.
        attached: what is held; it may touch what it rests on at the start.
        allowed: pairs of names, of bodies or of entities, that may touch.
        padding: [m] distance that a robot keeps from what is not itself, other robots too.
        velocity_scale: part of the joints' velocity limits that is used.
        acceleration: [rad/s^2] or [m/s^2] limit of each joint.
        seed: all that is random is drawn from it.
        deadline: [s] of the planner's own time.
    """

    joints: tuple[str, ...]
    start: Array
    goals: tuple[ToolGoal, ...] = ()
    pairing: Pairing = Pairing.PAIRED
    joint_goal: Array | None = None
    path: bool = True
    straight: float | None = None
    attached: tuple[Attachment, ...] = ()
    allowed: tuple[tuple[str, str], ...] = ()
    padding: float = 0.0
    velocity_scale: float = 1.0
    acceleration: float = 10.0
    seed: int = 0
    deadline: float = 5.0

    @property
    def kind(self) -> RequestKind:
        """By whether a path is asked for, and whether several tools are."""
        if sum(goal.enabled for goal in self.goals) > 1:
            return RequestKind.DUAL_MOTION if self.path else RequestKind.DUAL_IK
        return RequestKind.MOTION if self.path else RequestKind.IK

    def check(self) -> None:
        """Look for what no planner can answer.

        Raises:
            AnysimError: shapes that do not fit, values that are not finite, no goal or two kinds of goals.
        """
        used = [goal for goal in self.goals if goal.enabled]
        if bool(used) == (self.joint_goal is not None):
            raise AnysimError("a plan needs either goals of tools or a joint_goal; give one of the two")
        if not self.path and (self.joint_goal is not None or self.straight is not None):
            raise AnysimError(f"{self.kind} asks for the joints at poses of tools: leave joint_goal and straight out")
        arrays = {"start": (self.start, (len(self.joints),)), "joint_goal": (self.joint_goal, (len(self.joints),))}
        arrays |= {f"poses of '{goal.tool}'": (goal.poses, (len(goal.poses), 7)) for goal in used}
        arrays |= {f"offset of '{held.entity}'": (held.offset, (7,)) for held in self.attached}
        for name, (value, shape) in arrays.items():
            if value is not None and (np.shape(value) != shape or not np.isfinite(value).all()):
                raise AnysimError(f"{name}: expected finite numbers of shape {shape}, got shape {np.shape(value)}")
        if any(not length >= 0 for goal in used for length in goal.slide):
            raise AnysimError("expected lengths >= 0 of the slides of goals")
        widths = {len(goal.poses) for goal in used}
        if 0 in widths or (self.pairing is Pairing.PAIRED and len(widths) > 1):
            raise AnysimError(
                f"goal sets of {sorted(widths)} poses: expected some, as many for each tool that is paired"
            )
        if not (self.deadline > 0 and self.padding >= 0 and self.acceleration > 0 and 0 < self.velocity_scale <= 1):
            raise AnysimError("expected deadline and acceleration > 0, padding >= 0, velocity_scale above 0, at most 1")


class Scene(NamedTuple):
    """One env at one time; see `Scenes`.

    Attributes:
        version: counts the times that something other than a robot has moved.
        body_pose: (B, 7) world poses.
        present: (E,) bool, which entities are there.
    """

    version: int
    body_pose: Array
    present: Array


class Trajectory(NamedTuple):
    """Times (T,) [s] from 0, joint positions (T, K) and velocities (T, K), in the order of the request's joints."""

    times: Array
    joint_pos: Array
    joint_vel: Array


@dataclass(frozen=True, eq=False)
class PlanAnswer:
    """What became of a request.

    Attributes:
        status: of the whole.
        goal_status: (G) of each candidate of the (first) goal set; what was not tried is the status of the whole.
        chosen: for each goal the index of its candidate, -1 where there is none.
        trajectory: None unless `ok`, and where no path was asked for.
        joint_pos: (K,) at the chosen goals; None unless no path was asked for and it is `ok`.
        margins: by name: distance to the nearest joint limit, clearance at the goal.
        timings: [s] by stage; measured, so not part of what is reproducible.
        solver: the planner's name and version.
        world_version: of the scene that it was planned in.
        message: a sentence where it is not `ok`.
    """

    status: PlanStatus
    goal_status: tuple[PlanStatus, ...] = ()
    chosen: tuple[int, ...] = ()
    trajectory: Trajectory | None = None
    joint_pos: Array | None = None
    margins: Mapping[str, float] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)
    solver: str = ""
    world_version: int = 0
    message: str = ""


class Scenes:
    """N envs as planners see them. An env's version rises when something that is no robot has moved by a tolerance.

    Robots move all the time, by the very plans that are made: their poses are in a scene but do not age it.
    """

    def __init__(self, world: World, num_envs: int, tolerance: float = 0.002) -> None:
        """`tolerance` [m]; a turn counts by what it moves a point 0.1 m away."""
        robot = np.array([entity.kind is EntityKind.ROBOT for entity in world.entities] + [False])
        self._watched = (
            np.flatnonzero(~robot[np.array(world.body_entity, dtype=int)]) if world.bodies else np.zeros(0, int)
        )
        self._tolerance = tolerance
        self._known = np.full((num_envs, len(self._watched), 7), np.nan)
        self._body_pose = np.tile(world.initial_body_pose, (num_envs, 1, 1))
        self._present = np.tile(world.initial_presence, (num_envs, 1))
        self.version = np.zeros(num_envs, dtype=np.int64)
        self.update(self._body_pose)

    def update(self, body_pose: Array, present: Array | None = None) -> None:
        """Once a control step: world poses (N, B, 7) of all bodies, and which entities are there (N, E)."""
        here = body_pose[:, self._watched]
        shift = np.abs(here[..., :3] - self._known[..., :3]).max(axis=-1, initial=0.0)
        away = 1.0 - np.abs((here[..., 3:] * self._known[..., 3:]).sum(axis=-1))  # about angle^2 / 8
        same = (shift <= self._tolerance) & (away <= (self._tolerance / 0.1) ** 2 / 8)
        moved = ~same.all(axis=1)  # also of what is not a number, as nothing is known at first
        if present is not None:
            moved |= (present != self._present).any(axis=1)
            self._present = np.array(present, dtype=bool)
        self._known[moved] = here[moved]
        self.version[moved] += 1
        self._body_pose = np.array(body_pose, dtype=float)

    def scene(self, env: int) -> Scene:
        """A copy of what an env looks like now."""
        return Scene(int(self.version[env]), self._body_pose[env].copy(), self._present[env].copy())

    def is_stale(self, env: int, answer: PlanAnswer) -> bool:
        """Whether the env has changed since; such an answer is checked again with `MotionPlanner.is_free`."""
        return answer.world_version != self.version[env]


class Budget:
    """The time of one request and the wish to stop it. The planner looks at `spent` in its loops.

    Attributes:
        end: [s] of `time.perf_counter`, when the time is over; inf before it begins.
    """

    def __init__(self, deadline: float) -> None:
        self._deadline, self.end, self._cancelled = deadline, float("inf"), Event()

    def begin(self) -> None:
        """Start the clock; the service does it for each request when its turn comes."""
        self.end = perf_counter() + self._deadline

    def cancel(self) -> None:
        """Ask the planner to stop; from any thread."""
        self._cancelled.set()

    @property
    def spent(self) -> PlanStatus | None:
        """`cancelled`, `timeout`, or None to go on."""
        if self._cancelled.is_set():
            return PlanStatus.CANCELLED
        return PlanStatus.TIMEOUT if perf_counter() > self.end else None


class MotionPlanner(ABC):
    """Collision-free motion in one World. Each thread has an object of its own; `plan` is given checked requests.

    Attributes:
        name, version: for answers and manifests.
        capabilities: of `straight`, `paired`, `independent`, `attached`, `joint_goal`, `ik`: what it can do.
        fused: kinds of requests that its `plan_all`, where it overrides that, answers faster together.
    """

    name: ClassVar[str]
    version: ClassVar[str]
    capabilities: ClassVar[frozenset[str]]
    fused: ClassVar[frozenset[RequestKind]] = frozenset(RequestKind)

    def __init__(self, world: World) -> None:
        self.world = world

    def warm_up(self, request: PlanRequest, scene: Scene) -> None:
        """Load, compile and build what a request needs; services call it before the clock of the request begins."""

    @abstractmethod
    def plan(self, request: PlanRequest, scene: Scene, budget: Budget) -> PlanAnswer:
        """Search. Not finding a motion is a status, not an exception."""

    @abstractmethod
    def is_free(self, request: PlanRequest, scene: Scene, joint_pos: Array) -> bool:
        """Whether a path (T, K), straight between its rows, is free in a scene, 0.005 rad by 0.005 rad."""

    def plan_all(
        self, requests: Sequence[PlanRequest], scenes: Sequence[Scene], budgets: Sequence[Budget]
    ) -> list[PlanAnswer]:
        """Requests of one tick together; a planner overrides it if that saves time. Each answer is as if alone."""
        answers: list[PlanAnswer] = []
        for request, scene, budget in zip(requests, scenes, budgets, strict=True):
            budget.begin()
            answers.append(self.plan(request, scene, budget))
        return answers


def motion_planner(world: World, planner: str = "rrt", **options: object) -> MotionPlanner:
    """A planner by name for a world.

    Raises:
        PluginError: no planner of that name is installed, or what has that name solves inverse kinematics only.
    """
    made = registry.load("planners", planner)
    if not (isinstance(made, type) and issubclass(made, MotionPlanner)):
        raise PluginError(f"'{planner}' is no planner of motion: it solves inverse kinematics; try 'rrt'")
    with registry.using("planners", planner, (TypeError,)):  # of an option that it does not have
        return made(world, **options)
