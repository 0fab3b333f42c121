"""Rigid convex parts of an entity, for the layout: extents in any direction, fast for one pose at a time.

Plain floats where the sizes are small: an object is placed thousands of times, and a call of numpy costs more than the
arithmetic of a box. No linear algebra library is involved, so a result is the same on every machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.geometry.bounds import EntityShape
from anysim.model.world import BodyKind, Box, Capsule, Cylinder, Entity, Mesh, MeshShape, Shape, Sphere, World

Vec = tuple[float, float, float]
Matrix = tuple[Vec, Vec, Vec]
"""Rows."""

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


Quaternion = tuple[float, float, float, float]
"""xyzw, unit length."""


class Pose(NamedTuple):
    """Where a frame is: its origin [m], and the rotation from it to the world."""

    position: Vec
    rotation: Matrix


def matrix_of(quaternion: Sequence[float]) -> Matrix:
    """The rotation matrix of a unit quaternion xyzw."""
    x, y, z, w = (float(c) for c in quaternion)
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def turned(m: Matrix, v: Vec) -> Vec:
    """A vector rotated."""
    x, y, z = v
    a, b, c = m
    return (a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z, c[0] * x + c[1] * y + c[2] * z)


def product(a: Matrix, b: Matrix) -> Matrix:
    """The rotation b first, then a."""
    x, y, z = (turned(a, (b[0][k], b[1][k], b[2][k])) for k in range(3))
    return ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]))


def pose_of(row: Sequence[float] | Array) -> Pose:
    """Of a row (7,)."""
    return Pose((float(row[0]), float(row[1]), float(row[2])), matrix_of([float(c) for c in row[3:7]]))


def about_z(angle: float) -> Matrix:
    """A turn about the vertical."""
    c, s = cos(angle), sin(angle)
    return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))


def heading(m: Matrix) -> float:
    """The direction [rad] of the x axis, seen from above; of the y axis less a right angle where x is upright."""
    if abs(m[0][0]) + abs(m[1][0]) > 1e-6:
        return atan2(m[1][0], m[0][0])
    return atan2(-m[0][1], m[1][1])


@dataclass(frozen=True)
class Part:
    """A convex shape fixed to an entity's root. `vertices` (V, 3) for meshes, in the shape's frame."""

    shape: Shape
    pose: Pose
    body: int
    vertices: Array | None = field(default=None, compare=False, repr=False)

    def reach(self, rotation: Matrix, n: Vec) -> float:
        """How far the shape goes from its own origin in a unit direction of the world, turned by `rotation`."""
        a = rotation[0][0] * n[0] + rotation[1][0] * n[1] + rotation[2][0] * n[2]
        b = rotation[0][1] * n[0] + rotation[1][1] * n[1] + rotation[2][1] * n[2]
        c = rotation[0][2] * n[0] + rotation[1][2] * n[1] + rotation[2][2] * n[2]
        match self.shape:
            case Box((x, y, z)):
                return abs(a) * x + abs(b) * y + abs(c) * z
            case Sphere(radius):
                return radius
            case Capsule(radius, half_length):
                return abs(c) * half_length + radius
            case Cylinder(radius, half_length):
                return abs(c) * half_length + radius * sqrt(max(0.0, 1.0 - c * c))
        v = self.vertices
        assert v is not None  # a mesh
        return float((v[:, 0] * a + v[:, 1] * b + v[:, 2] * c).max())


AXES: tuple[Vec, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class PlacedPart(NamedTuple):
    """A part at its place in the world, with the box around it."""

    part: Part
    pose: Pose
    low: Vec
    high: Vec


@dataclass(frozen=True)
class PlacedSolid:
    """A solid at its place in the world, with the box around it."""

    name: str
    pose: Pose
    parts: tuple[PlacedPart, ...]
    low: Vec
    high: Vec

    @property
    def center(self) -> Vec:
        """The middle of the box around it."""
        return (
            0.5 * (self.low[0] + self.high[0]),
            0.5 * (self.low[1] + self.high[1]),
            0.5 * (self.low[2] + self.high[2]),
        )


class Solid:
    """An entity as rigid convex parts, its joints at their initial positions."""

    def __init__(self, world: World, entity: Entity) -> None:
        self.name = entity.name
        self.fixed = world.bodies[entity.root].kind is BodyKind.STATIC
        shape = EntityShape(world, entity.name)
        meshes = {mesh.name: mesh for mesh in world.meshes}
        self.parts = tuple(_part(placed.shape, placed.pose, body, meshes) for placed, body in shape.owned)
        self.collides = shape.collides

    def at(self, pose: Pose) -> PlacedSolid:
        """With its root somewhere."""
        placed: list[PlacedPart] = []
        for part in self.parts:
            offset = turned(pose.rotation, part.pose.position)
            here = (pose.position[0] + offset[0], pose.position[1] + offset[1], pose.position[2] + offset[2])
            rotation = product(pose.rotation, part.pose.rotation) if part.pose.rotation != IDENTITY else pose.rotation
            placed.append(boxed(part, Pose(here, rotation)))
        if not placed:
            return PlacedSolid(self.name, pose, (), pose.position, pose.position)
        low = tuple(min(p.low[k] for p in placed) for k in range(3))
        high = tuple(max(p.high[k] for p in placed) for k in range(3))
        return PlacedSolid(self.name, pose, tuple(placed), low, high)  # type: ignore[arg-type]

    def reach(self, rotation: Matrix, n: Vec) -> float:
        """How far it goes from its root's origin in a unit direction of the world, the root turned by `rotation`."""
        farthest = None
        for part in self.parts:
            offset = turned(rotation, part.pose.position)
            own = product(rotation, part.pose.rotation) if part.pose.rotation != IDENTITY else rotation
            value = offset[0] * n[0] + offset[1] * n[1] + offset[2] * n[2] + part.reach(own, n)
            farthest = value if farthest is None or value > farthest else farthest
        return 0.0 if farthest is None else farthest


def _part(shape: Shape, pose: Array, body: int, meshes: dict[str, Mesh]) -> Part:
    vertices = meshes[shape.mesh].vertices if isinstance(shape, MeshShape) else None
    return Part(shape, pose_of(pose), body, vertices)


def boxed(part: Part, pose: Pose) -> PlacedPart:
    """A part at its place."""
    p = pose.position
    if part.vertices is not None:
        v, low, high = part.vertices, [0.0] * 3, [0.0] * 3
        for k, row in enumerate(pose.rotation):
            along = v[:, 0] * row[0] + v[:, 1] * row[1] + v[:, 2] * row[2]
            low[k], high[k] = p[k] + float(along.min()), p[k] + float(along.max())
        return PlacedPart(part, pose, (low[0], low[1], low[2]), (high[0], high[1], high[2]))
    x, y, z = (part.reach(pose.rotation, axis) for axis in AXES)
    return PlacedPart(part, pose, (p[0] - x, p[1] - y, p[2] - z), (p[0] + x, p[1] + y, p[2] + z))


def row_of(pose: Pose, quaternion: Sequence[float]) -> Array:
    """A row (7,) of a place and the quaternion that its rotation came from."""
    return np.array([*pose.position, *quaternion], dtype=float)


def quaternion_of(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Fixed-axis roll, then pitch, then yaw."""
    sr, cr, sp, cp = sin(0.5 * roll), cos(0.5 * roll), sin(0.5 * pitch), cos(0.5 * pitch)
    sy, cy = sin(0.5 * yaw), cos(0.5 * yaw)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def times(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation b first, then a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def turn_about_z(angle: float) -> Quaternion:
    """A turn about the vertical."""
    return (0.0, 0.0, sin(0.5 * angle), cos(0.5 * angle))
