"""Tool motion carried from one robot to another: joint positions that take another arm's tool along the same poses.

The motion is told in the frame of the arm's base, so an arm that stands elsewhere makes it before itself. Which posture
the new arm begins in decides how far it comes: several are tried, and the one that follows the motion best is kept.
"""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError, NameLookupError, RecordError, listing, suggest
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.world import BodyKind, EntityKind, World
from anysim.planning.api import ALL_AXES, inverse_kinematics
from anysim.planning.motion import PlanRequest, Scene
from anysim.record.reader import TrajectoryReader
from anysim_planning.scene import PlanningWorld

JUMP = 0.5
"""[rad] or [m] that no joint moves between two rows: more is another posture."""
STARTS = 24
"""Postures to begin in: the arm's initial one, and random ones."""


class Retargeted(NamedTuple):
    """A motion of T rows as another arm makes it.

    Attributes:
        times: (T,) [s] those of the motion, slowed down as a whole where joints would be too fast.
        joint_pos: (T, K) within the limits.
        reached: (T,) bool, both errors are within the tolerances and no joint has jumped.
        position_error: (T,) [m]
        rotation_error: (T,) [rad]
        free: (T,) bool, the robot touches neither itself nor what stands around it; all True where it was not checked.
    """

    times: Array
    joint_pos: Array
    reached: Array
    position_error: Array
    rotation_error: Array
    free: Array


class Surroundings:
    """What the arm of a chain may not touch in a world as it begins: its own robot, and all that is not loose."""

    def __init__(self, world: World, chain: Chain) -> None:
        scene = Scene(0, world.initial_body_pose, world.initial_presence)
        robot = world.entities[world.body_entity[chain.root]].name
        loose = [
            e for e in world.entities if e.kind is not EntityKind.ROBOT and world.bodies[e.root].kind is BodyKind.FREE
        ]
        allowed = tuple((robot, entity.name) for entity in loose)
        self._checks = PlanningWorld(
            world, PlanRequest(chain.joint_names, chain.initial, allowed=allowed), {}, every_link=True
        )
        self._checks.take(scene, ())

    def hits(self, joint_pos: Array) -> Array:
        """(n,) bool: which joint positions (n, K) touch something."""
        return self._checks.hits(np.ascontiguousarray(joint_pos))

    def touching(self, joint_pos: Array) -> tuple[str, str]:
        """Names of the first two geoms that touch in joint positions (K,) that hit."""
        return self._checks.touching(joint_pos)[0]


class ToolMotion(NamedTuple):
    """Times (T,) [s], world poses (T, 7) of a tool, and world poses (T, 7) of its robot's root body."""

    times: Array
    poses: Array
    base: Array


def tool_motion(recording: TrajectoryReader, world: World, robot: str, tool: str) -> ToolMotion:
    """What a robot's tool did in a recording; `world` is the one that it was made in.

    Raises:
        RecordError: the recording has no poses of bodies, or other bodies.
        NameLookupError: there is no such tool.
    """
    site = world.sites[_tool(world, robot, tool)]
    root = world.bodies[world.entities[world.entity_numbers[robot]].body_start].name
    names, wanted = recording.manifest.layout.bodies, (world.bodies[site.body].name, root)
    if "body_pose" not in recording.states or not set(wanted) <= set(names):
        raise RecordError(f"{recording.directory} has no poses of {listing(wanted)}; its bodies are {listing(names)}")
    rows = recording.states["body_pose"]
    poses, base = (np.asarray(rows[:, names.index(name)], dtype=float) for name in wanted)
    return ToolMotion(recording.times, P.compose(poses, P.pose(site.position, site.quaternion)), base)


def only_tool(world: World, robot: str | None = None, tool: str | None = None) -> tuple[str, str]:
    """Robot and tool; what is None may be left out where there is one alone.

    Raises:
        NameLookupError: there is no such tool, or several are meant.
    """
    known = [(r.name, name) for r in world.robots for name in r.tools]
    meant = [one for one in known if robot in (None, one[0]) and tool in (None, one[1])]
    if len(meant) != 1:
        names = listing([".".join(one) for one in meant or known])
        raise NameLookupError(f"{len(meant)} tools are meant; name the robot and one of its tools: {names}")
    return meant[0]


def arm_of(world: World, robot: str, tool: str) -> Chain:
    """The joints of a robot's channels that move a tool: one arm of a robot that has two.

    Raises:
        NameLookupError: there is no such tool.
    """
    body, above = world.sites[_tool(world, robot, tool)].body, list[int]()
    while body >= 0:
        above.append(world.body_joint[body])
        body = world.bodies[body].parent
    channels = next(r for r in world.robots if r.name == robot).channels
    for name, channel in channels.items():
        if joints := [j for j in channel.joints if j in above]:
            return Chain.from_world(world, robot, name, tool, joints=joints)
    raise AnysimError(f"the tool '{tool}' of {robot} hangs from no joint of its channels ({listing(channels)})")


def carried(poses: Array, base: Array, onto: Array, shift: Array | None = None) -> Array:
    """World poses (T, 7) of a tool, seen from one base (7,) or (T, 7), as world poses seen from another base (7,).

    `shift` (7,) moves the motion in the frame of the base, for an arm that reaches less far or stands higher.
    """
    local = P.compose(P.inverse(np.broadcast_to(base, poses.shape)), poses)
    local = local if shift is None else P.compose(np.broadcast_to(shift, poses.shape), local)
    return P.compose(np.broadcast_to(onto, poses.shape), local)


def retarget(
    chain: Chain,
    base: Array,
    times: Array,
    poses: Array,
    *,
    seed: int = 0,
    position_tolerance: float = 1e-4,
    rotation_tolerance: float = 1e-3,
    rotation_weight: tuple[float, float, float] = ALL_AXES,
    solver: str = "numba_ik",
    around: Surroundings | None = None,
) -> Retargeted:
    """Follow world poses (T, 7) of a tool at times (T,) with an arm whose root body is at `base` (7,).

    The objective is that of the planners' goals: each row is solved from the row before, without restarts, so that the
    arm keeps its posture; a row out of reach is the nearest that the solver finds. With `around` it begins in the
    posture from which the most rows are both reached and free.

    Raises:
        AnysimError: times that do not rise, or poses of another shape.
    """
    times, poses = np.asarray(times, dtype=float), np.asarray(poses, dtype=float)
    if poses.shape != (len(times), 7) or not len(times) or (np.diff(times) <= 0).any():
        raise AnysimError(f"a motion needs rising times (T,) and poses (T, 7), got {times.shape} and {poses.shape}")
    tolerances = {"position_tolerance": position_tolerance, "rotation_tolerance": rotation_tolerance}
    ik = inverse_kinematics(chain, solver, threads=1, **tolerances)
    rng = np.random.default_rng(seed)
    low = np.where(np.isfinite(chain.lower), chain.lower, -np.pi)
    high = np.where(np.isfinite(chain.upper), chain.upper, np.pi)
    q = np.concatenate([chain.initial[None], rng.uniform(low, high, (STARTS - 1, len(chain)))])
    bases, keys = np.tile(np.asarray(base, dtype=float), (STARTS, 1)), np.arange(STARTS, dtype=np.uint64)
    rows, errors, good = [], [], []
    for row, pose in enumerate(poses):
        found = ik.solve(
            np.tile(pose, (STARTS, 1)),
            bases,
            q,
            random_restarts=0 if row else 20,
            rng_seeds=keys + np.uint64(seed),
            rotation_weight=rotation_weight,
        )
        moved = np.abs(found.joint_pos - q).max(axis=1)
        good.append(found.converged & ((moved <= JUMP) | (row == 0)))
        q = found.joint_pos
        rows.append(q)
        errors.append((found.position_error, found.rotation_error))
    path, reached = np.array(rows), np.array(good)  # (T, starts, K), (T, starts)
    free = np.ones(reached.shape, dtype=bool)
    if around is not None:
        free = ~around.hits(path.reshape(-1, len(chain))).reshape(reached.shape)
    travel = np.abs(np.diff(path, axis=0)).sum(axis=(0, 2))
    best = int(np.lexsort((travel, -(reached & free).sum(axis=0)))[0])
    position, rotation = (np.array([pair[i][best] for pair in errors]) for i in (0, 1))
    slowed = _slowed(times, path[:, best], chain)
    return Retargeted(slowed, path[:, best], reached[:, best], position, rotation, free[:, best])


def _tool(world: World, robot: str, tool: str) -> int:
    known = {f"{r.name}.{name}": site for r in world.robots for name, site in r.tools.items()}
    name = f"{robot}.{tool}"
    if name not in known:
        raise NameLookupError(f"there is no tool '{name}'{suggest(name, list(known))} (tools: {listing(known)})")
    return known[name]


def _slowed(times: Array, joint_pos: Array, chain: Chain) -> Array:
    if len(times) < 2:
        return times
    speed = np.abs(np.diff(joint_pos, axis=0)) / np.diff(times)[:, None]
    return times[0] + (times - times[0]) * max(1.0, float((speed / chain.velocity_limit).max()))
