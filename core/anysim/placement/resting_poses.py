"""Resting poses of a shape on a level surface, and how likely each is when the thing is dropped.

A pose is stable where the centre of mass lies above the face of the convex hull that it rests on. A face gets the share
of all directions that it fills as seen from the centre of mass; that of an unstable face goes to the one it topples
onto, across the edge nearest to the centre of mass (after Goldberg, Mirtich, Zhuang, Craig, Carlisle and Canny, Part
pose statistics, IEEE Transactions on Robotics and Automation 15(5), 1999).
"""

from collections.abc import Sequence
from math import pi, radians, tan
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.geometry.convex_parts import Part, Solid, turned
from anysim.math import matrix as M, pose as P
from anysim.model.world import Box, Capsule, Cylinder, MeshShape, Sphere, World

ROUND = 32
"""Sides of the prism that stands for something round in a hull."""

TILT = radians(4.0)
"""Poses that less than this turns over are left out: engines and their margins are not that exact."""

INSIDE = 0.0015
"""[m] from the edge of the face that the centre of mass must be above it: Bullet rounds the edges of hulls by 1 mm."""

SMALLEST = 0.005
"""Share of the drops from which on a pose counts."""


class RestingPose(NamedTuple):
    """An orientation (xyzw) in which a thing rests, and how likely it is. `roll` is a free turn about its own axis."""

    quaternion: tuple[float, float, float, float]
    share: float
    rolls: tuple[float, float, float] | None = None


def resting_poses(world: World, solid: Solid) -> tuple[RestingPose, ...]:
    """The stable poses of an entity with its joints at their initial positions, the likeliest first; never empty.

    A thing without a stable pose, or with any (a ball), rests as it is.
    """
    as_it_is = RestingPose((0.0, 0.0, 0.0, 1.0), 1.0)
    if not solid.parts or (len(solid.parts) == 1 and isinstance(solid.parts[0].shape, Sphere)):
        return (as_it_is,)
    lone = solid.parts[0] if len(solid.parts) == 1 else None
    if lone is not None and isinstance(lone.shape, Capsule):
        return (RestingPose(_lying(lone), 1.0, _axis(lone)),)
    points = np.concatenate([_points(part) for part in solid.parts])
    com = _center_of_mass(world, solid)
    if lone is not None and isinstance(lone.shape, Cylinder):
        return _cylinder(lone, com, points)
    found = _from_hull(points, com)
    return found or (as_it_is,)


def _from_hull(points: Array, com: Array) -> tuple[RestingPose, ...]:
    normals, outlines, shares = _faces(points, com)
    poses: list[RestingPose] = []
    settled = _toppled(normals, outlines, shares, com)
    for normal, share in zip(normals, settled, strict=True):
        if share >= SMALLEST:
            poses.append(RestingPose(_onto(normal), share))
    total = sum(pose.share for pose in poses)
    ordered = sorted(poses, key=lambda pose: (-round(pose.share, 6), pose.quaternion))
    return tuple(pose._replace(share=pose.share / total) for pose in ordered)


def _faces(points: Array, com: Array) -> tuple[list[Array], list[Array], list[float]]:
    """Outward normals, outlines (K, 3) and shares of all directions of the faces of a hull, coplanar facets as one."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    groups: list[tuple[Array, list[int]]] = []
    for number, plane in enumerate(hull.equations):
        for known, members in groups:
            if P.dot(known[:3], plane[:3]) > 1 - 1e-6 and abs(known[3] - plane[3]) < 1e-5:
                members.append(number)
                break
        else:
            groups.append((plane, [number]))
    normals, outlines, shares = [], [], []
    for plane, members in groups:
        normal = plane[:3] / P.norm(plane[:3])
        corners = points[np.unique(hull.simplices[members])]
        a, b = _plane_axes(normal)
        middle = corners.mean(axis=0)
        order = np.argsort(np.arctan2(P.dot(corners - middle, b), P.dot(corners - middle, a)))
        normals.append(normal)
        outlines.append(corners[order])
        shares.append(sum(_solid_angle(*(points[i] - com for i in hull.simplices[m])) for m in members) / (4 * pi))
    return normals, outlines, shares


def _toppled(normals: Sequence[Array], outlines: Sequence[Array], shares: Sequence[float], com: Array) -> list[float]:
    """The shares after everything has toppled to where it stays."""
    onto = [_topples_to(k, normals, outlines, com) for k in range(len(normals))]
    settled = [0.0] * len(normals)
    for start, share in enumerate(shares):
        here, seen = start, {start}
        while (following := onto[here]) is not None and following not in seen:
            here = following
            seen.add(here)
        if following is None:
            settled[here] += share
    return settled


def _topples_to(face: int, normals: Sequence[Array], outlines: Sequence[Array], com: Array) -> int | None:
    """The neighbour that a face topples onto; None where it is stable."""
    normal, corners = normals[face], outlines[face]
    following = np.roll(corners, -1, axis=0)
    along = following - corners
    inward = np.cross(normal, along)
    length = P.norm(inward)
    keep = length > 1e-12
    depth = np.where(keep, ((com - corners) * inward).sum(axis=1) / np.where(keep, length, 1.0), np.inf)
    worst = int(np.argmin(depth))
    height = float(P.dot(corners[0] - com, normal))  # of the centre of mass above the face
    if depth[worst] > max(height * tan(TILT), INSIDE):
        return None
    edge = {tuple(np.round(corners[worst], 9)), tuple(np.round(following[worst], 9))}
    for other, outline in enumerate(outlines):
        if other != face and edge <= {tuple(np.round(corner, 9)) for corner in outline}:
            return other
    return None if depth[worst] > 0 else face


def _solid_angle(a: Array, b: Array, c: Array) -> float:
    """Of a triangle seen from the origin (van Oosterom and Strackee)."""
    la, lb, lc = (float(P.norm(v)) for v in (a, b, c))
    top = float(P.dot(a, np.cross(b, c)))
    return abs(2 * float(np.arctan2(top, la * lb * lc + P.dot(a, b) * lc + P.dot(b, c) * la + P.dot(c, a) * lb)))


def _cylinder(part: Part, com: Array, points: Array) -> tuple[RestingPose, ...]:
    """Upright or upside down; on its side, where it rolls and so never quite rests, only if it cannot stand."""
    assert isinstance(part.shape, Cylinder)
    axis = np.array(_axis(part))
    poses: list[RestingPose] = []
    normals, outlines, shares = _faces(points, com)
    settled = _toppled(normals, outlines, shares, com)
    for normal, share in zip(normals, settled, strict=True):
        if abs(float(P.dot(normal, axis))) > 0.999 and share >= SMALLEST:
            poses.append(RestingPose(_onto(normal), share))
    if not poses:
        return (RestingPose(_lying(part), 1.0, _axis(part)),)
    total = sum(pose.share for pose in poses)
    ordered = sorted(poses, key=lambda pose: (-round(pose.share, 6), pose.quaternion))
    return tuple(pose._replace(share=pose.share / total) for pose in ordered)


def _axis(part: Part) -> tuple[float, float, float]:
    return turned(part.pose.rotation, (0.0, 0.0, 1.0))


def _lying(part: Part) -> tuple[float, float, float, float]:
    """With the part's axis level."""
    x, y, z = _axis(part)
    side = np.array([x, y, 0.0])
    level = side / P.norm(side) if P.norm(side) > 1e-6 else np.array([1.0, 0.0, 0.0])
    return _between(np.array([x, y, z]), level)


def _onto(normal: Array) -> tuple[float, float, float, float]:
    """The least turn that brings a face down."""
    return _between(normal, np.array([0.0, 0.0, -1.0]))


def _between(a: Array, b: Array) -> tuple[float, float, float, float]:
    """The least rotation from one unit vector to another; about x where they are opposed."""
    w = 1.0 + float(P.dot(a, b))
    if w < 1e-9:
        axis = np.array([1.0, 0.0, 0.0]) if abs(a[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
        perpendicular = np.cross(a, axis)
        q = np.array([*(perpendicular / P.norm(perpendicular)), 0.0])
    else:
        q = P.normalize(np.array([*np.cross(a, b), w]))
    x, y, z, w = (float(c) for c in np.round(q, 12) + 0.0)
    return x, y, z, w


def _plane_axes(normal: Array) -> tuple[Array, Array]:
    a = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    a = a / P.norm(a)
    return a, np.cross(normal, a)


def _points(part: Part) -> Array:
    """Points whose hull is the part, in the root frame."""
    match part.shape:
        case Box((x, y, z)):
            local = np.array([[sx * x, sy * y, sz * z] for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)])
        case Cylinder(radius, half):
            local = _ring(radius, (-half, half))
        case Capsule(radius, half):
            local = np.concatenate(
                [
                    _ring(radius * c, (-half - radius * s, half + radius * s))
                    for c, s in ((1.0, 0.0), (0.92, 0.38), (0.71, 0.71), (0.38, 0.92))
                ]
            )
        case Sphere(radius):
            local = np.concatenate(
                [
                    _ring(radius * c, (-radius * s, radius * s))
                    for c, s in ((1.0, 0.0), (0.92, 0.38), (0.71, 0.71), (0.38, 0.92))
                ]
            )
        case MeshShape():
            assert part.vertices is not None
            local = part.vertices
        case _:
            local = np.zeros((1, 3))
    rotation = np.array(part.pose.rotation)
    return M.product(local, rotation.T) + np.array(part.pose.position)


def _ring(radius: float, heights: Sequence[float]) -> Array:
    turns = 2 * pi * np.arange(ROUND) / ROUND
    return np.array([[radius * np.cos(t), radius * np.sin(t), h] for t in turns for h in heights])


def _center_of_mass(world: World, solid: Solid) -> Array:
    """Of an entity in its root frame, joints at their initial positions; of its box where it has no mass."""
    entity = world.entities[world.entity_numbers[solid.name]]
    root = P.inverse(world.initial_body_pose[entity.root])
    total, weighted = 0.0, np.zeros(3)
    for body in range(entity.body_start, entity.body_stop):
        inertial = world.bodies[body].inertial
        here = P.compose(root, world.initial_body_pose[body])
        weighted += inertial.mass * (here[:3] + P.rotate(here[3:], np.array(inertial.com)))
        total += inertial.mass
    if total > 0:
        return weighted / total
    points = np.concatenate([_points(part) for part in solid.parts])
    return 0.5 * (points.min(axis=0) + points.max(axis=0))
