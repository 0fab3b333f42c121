"""Clearance of paths by plain arithmetic: what is round becomes balls, and balls are measured against all else."""

from itertools import pairwise

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.math import pose as P
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.pairs import may_meet
from anysim.model.parts import EntityKind
from anysim.model.shapes import Box, Capsule, Shape, Sphere
from anysim.model.world import Geom, World
from anysim.planning.motion import PlanRequest, Scene, Trajectory

STEP = 0.005
"""[rad] between the configurations that are measured."""
POINTS = 15
"""Balls of a capsule: it is measured at most 0.5 mm too slim."""


def filled(joint_pos: Array, step: float = STEP) -> Array:
    """A path (T, K) with rows added, so that no joint moves by more than `step` between two."""
    rows = [joint_pos[:1]]
    for a, b in pairwise(joint_pos):
        count = max(1, int(np.ceil(np.abs(b - a).max() / step)))
        rows.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(rows)


def clearance(world: World, scene: Scene, request: PlanRequest, joint_pos: Array) -> tuple[float, float]:
    """The smallest distance [m] along a path (T, K), negative inside: from what is not a robot, and between robots.

    Links of one robot that touch at its initial joint positions are left out, as are pairs that are allowed.
    """
    order = [[joint.name for joint in world.joints].index(name) for name in request.joints]
    rows = filled(np.asarray(joint_pos, dtype=float))
    positions = np.tile([joint.initial for joint in world.joints], (len(rows), 1))
    positions[:, order] = rows
    poses = _poses(world, scene, request, positions)
    home = _poses(world, scene, request, np.array([[joint.initial for joint in world.joints]]))
    world_distance = robot_distance = np.inf
    for first, second, robots in _pairs(world, scene, request):
        if robots and _entity(world, first) == _entity(world, second) and _distance(first, second, home).min() <= 0:
            continue
        distance = float(_distance(first, second, poses).min())
        if robots:
            robot_distance = min(robot_distance, distance)
        else:
            world_distance = min(world_distance, distance)
    return world_distance, robot_distance


def breaks(world: World, request: PlanRequest, trajectory: Trajectory) -> list[str]:
    """Which limits a trajectory does not keep, within 0.2 %: of positions, velocities and accelerations; its times."""
    times, position, velocity = trajectory
    joints = {joint.name: joint for joint in world.joints}
    picked = [joints[name] for name in request.joints]
    most = np.array([joint.velocity_limit for joint in picked]) * request.velocity_scale * 1.002
    lower, upper = np.array([j.lower for j in picked]), np.array([j.upper for j in picked])
    spans = np.diff(times)[:, None]
    if times[0] != 0 or not (spans > 0).all():
        return ["times begin at 0 and rise"]
    rules = {
        "positions within the joints' limits": ((position >= lower - 1e-6) & (position <= upper + 1e-6)).all(),
        "velocities within their limits": (np.abs(velocity) <= most).all(),
        "positions that follow within the velocity limits": (np.abs(np.diff(position, axis=0)) <= most * spans).all(),
        "accelerations within their limit": (
            np.abs(np.diff(velocity, axis=0)) <= request.acceleration * 1.002 * spans
        ).all(),
        "velocities that are those of the positions": np.allclose(
            np.diff(position, axis=0), 0.5 * (velocity[1:] + velocity[:-1]) * spans, atol=2e-3
        ),
        "rest at both ends": not np.abs(velocity[[0, -1]]).max() > 1e-6,
    }
    return [rule for rule, kept in rules.items() if not kept]


def _poses(world: World, scene: Scene, request: PlanRequest, positions: Array) -> Array:
    poses = forward_kinematics(world, np.tile(scene.body_pose, (len(positions), 1, 1)), positions)
    names = [body.name for body in world.bodies]
    for held in request.attached:
        root = world.entities[world.entity_numbers[held.entity]].body_start
        poses[:, root] = P.compose(poses[:, names.index(held.body)], np.asarray(held.offset, dtype=float))
    return poses


def _pairs(world: World, scene: Scene, request: PlanRequest) -> list[tuple[Geom, Geom, bool]]:
    """What may collide with what, the round one first; and whether both belong to robots."""
    bodies = np.array([geom.body for geom in world.geoms])
    meet = may_meet(world, bodies)
    present = [geom.body == WORLD or scene.present[world.body_entity[geom.body]] for geom in world.geoms]
    held = {one.entity: one.body for one in request.attached}
    found: list[tuple[Geom, Geom, bool]] = []
    for i, j in zip(*np.nonzero(np.triu(meet)), strict=True):
        one, two = world.geoms[i], world.geoms[j]
        movers = [g for g in (one, two) if _is_robot(world, g) or _entity(world, g) in held]
        if not (present[i] and present[j] and movers) or _allowed(world, request, one, two):
            continue
        if any(
            _entity(world, a) in held and _near_holder(world, b, held[_entity(world, a)]) for a, b in _both(one, two)
        ):
            continue
        swap = one not in movers or (len(movers) == 2 and isinstance(one.shape, Box))
        first, second = (two, one) if swap else (one, two)
        found.append((first, second, _is_robot(world, one) and _is_robot(world, two)))
    return found


def _both(one: Geom, two: Geom) -> tuple[tuple[Geom, Geom], tuple[Geom, Geom]]:
    return (one, two), (two, one)


def _near_holder(world: World, geom: Geom, holder: str) -> bool:
    if geom.body == WORLD:
        return False
    body = world.bodies[geom.body]
    return body.name == holder or (body.parent != WORLD and world.bodies[body.parent].name == holder)


def _entity(world: World, geom: Geom) -> str:
    return "terrain" if geom.body == WORLD else world.entities[world.body_entity[geom.body]].name


def _is_robot(world: World, geom: Geom) -> bool:
    return geom.body != WORLD and world.entities[world.body_entity[geom.body]].kind is EntityKind.ROBOT


def _allowed(world: World, request: PlanRequest, one: Geom, two: Geom) -> bool:
    names = [{_entity(world, g), "" if g.body == WORLD else world.bodies[g.body].name} for g in (one, two)]
    return any((a in names[0] and b in names[1]) or (b in names[0] and a in names[1]) for a, b in request.allowed)


def _distance(first: Geom, second: Geom, poses: Array) -> Array:
    """(T,) the least distance of the balls of the first shape from the second one."""
    points, radius = _balls(first.shape)
    there = _placed(first, points, poses)
    if second.body == WORLD:
        return there[..., 2].min(axis=1) - radius
    if isinstance(second.shape, Box):
        frame = P.compose(poses[:, second.body], P.pose(second.position, second.quaternion))[:, None]
        local = P.rotate_inverse(np.broadcast_to(frame[..., 3:], (*there.shape[:2], 4)), there - frame[..., :3])
        out = np.abs(local) - np.array(second.shape.half_size)
        outside = np.linalg.norm(np.maximum(out, 0.0), axis=-1)
        return (outside + np.minimum(out.max(axis=-1), 0.0)).min(axis=1) - radius
    others, more = _balls(second.shape)
    away = there[:, :, None] - _placed(second, others, poses)[:, None]
    return np.sqrt(np.einsum("tabc,tabc->tab", away, away).min(axis=(1, 2))) - radius - more


def _placed(geom: Geom, points: Array, poses: Array) -> Array:
    """Points (n, 3) of a shape in the world, (T, n, 3)."""
    frame = P.compose(poses[:, geom.body], P.pose(geom.position, geom.quaternion))[:, None]
    turned = P.rotate(np.broadcast_to(frame[..., 3:], (len(poses), len(points), 4)), points[None])
    return turned + frame[..., :3]


def _balls(shape: Shape) -> tuple[Array, float]:
    """Centres (n, 3) and the radius of balls that make up a shape; a box is a grid of points on its surface."""
    match shape:
        case Sphere(radius):
            return np.zeros((1, 3)), radius
        case Capsule(radius, half_length):
            return np.linspace(-half_length, half_length, POINTS)[:, None] * [0.0, 0.0, 1.0], radius
        case Box(half_size):
            line = np.linspace(-1.0, 1.0, 5)
            grid = np.stack(np.meshgrid(line, line, line), axis=-1).reshape(-1, 3)
            return grid[np.abs(grid).max(axis=1) == 1.0] * half_size, 0.0
        case _:
            raise TypeError(f"{shape} is no ball, capsule or box")
