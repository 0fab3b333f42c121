"""Distances between placed things, by their real shapes: boxes first, exact convex distances for what is near.

The exact ones are from Coal (GJK and EPA): each query starts afresh and is made on one thread, so equal input gives
equal output. A query between shapes changes neither of them.
"""

from math import inf
from typing import Any

import numpy as np

from anysim.conventions import WORLD
from anysim.geometry.bounds import ground_top
from anysim.geometry.coal_solids import coal_hull, coal_solid
from anysim.geometry.convex_parts import IDENTITY, Part, PlacedPart, PlacedSolid, Pose, Vec, boxed, pose_of, turned
from anysim.model.world import Box, Capsule, Cylinder, HeightFieldShape, MeshShape, Plane, Shape, Sphere, World

TOUCH = 1e-4
"""[m] that things may start inside of each other: what rests on something touches it."""


class ClearanceQuery:
    """Distances in one World. Shapes are made for Coal once, when they are first near to something."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._geometries: dict[int, Any] = {}
        self._kept: list[Part] = []
        self._excluded = world.excluded_pairs
        ground = [g for g in world.geoms if g.body == WORLD and g.collides]
        self._planes = max((g.position[2] for g in ground if isinstance(g.shape, Plane)), default=None)
        self._fields = any(isinstance(g.shape, HeightFieldShape) or _concave(g.shape) for g in ground)
        meshes = {mesh.name: mesh for mesh in world.meshes}
        known = (Box, Sphere, Capsule, Cylinder, MeshShape)
        parts = [
            Part(
                g.shape,
                pose_of((*g.position, *g.quaternion)),
                WORLD,
                meshes[g.shape.mesh].vertices if isinstance(g.shape, MeshShape) else None,
            )
            for g in ground
            if isinstance(g.shape, known) and not _concave(g.shape)
        ]
        self.walls = _placed("terrain", parts)
        """What stands on the ground and is part of it; None where there is nothing."""

    def gap(self, a: PlacedSolid, b: PlacedSolid, limit: float) -> float:
        """The least distance [m] between two things; negative where they are in each other, inf beyond `limit`."""
        if _apart(a.low, a.high, b.low, b.high, limit):
            return inf
        least = inf
        for one in a.parts:
            if _apart(one.low, one.high, b.low, b.high, limit):
                continue
            for other in b.parts:
                if _apart(one.low, one.high, other.low, other.high, limit):
                    continue
                pair = (one.part.body, other.part.body)
                if self._excluded and (min(pair), max(pair)) in self._excluded:
                    continue
                least = min(least, self._distance(one, other))
        return least

    def above_ground(self, a: PlacedSolid) -> bool:
        """Whether no part of a thing is below the ground."""
        if self._planes is not None and a.parts and a.low[2] < self._planes - TOUCH:
            return not any(p.low[2] < self._planes - TOUCH and not self._free_of_ground(p) for p in a.parts)
        if self._fields:
            return all(self._above_field(p) for p in a.parts)
        return True

    def _free_of_ground(self, one: PlacedPart) -> bool:
        return (WORLD, one.part.body) in self._excluded

    def _above_field(self, one: PlacedPart) -> bool:
        top = float(ground_top(self._world, np.array(one.low[:2]), np.array(one.high[:2])))
        if one.low[2] >= top - TOUCH or self._free_of_ground(one):
            return True
        return all(z >= self._height_at(x, y) - TOUCH for x, y, z in _low_points(one))

    def _height_at(self, x: float, y: float) -> float:
        point = np.array([x, y])
        return float(ground_top(self._world, point, point))

    def _distance(self, one: PlacedPart, other: PlacedPart) -> float:
        import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

        a, b = self._geometry(one.part), self._geometry(other.part)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        at = [coal.Transform3s(np.array(p.pose.rotation), np.array(p.pose.position)) for p in (one, other)]
        return float(coal.distance(a, at[0], b, at[1], request, result))

    def _geometry(self, part: Part) -> Any:
        found = self._geometries.get(id(part))
        if found is None:
            found = self._geometries[id(part)] = _geometry(part)
            self._kept.append(part)  # so that its id stays its own
        return found


def _concave(shape: Shape) -> bool:
    """Whether a mesh is ground, triangle by triangle."""
    return bool(getattr(shape, "concave", False))


def _placed(name: str, parts: list[Part]) -> PlacedSolid | None:
    if not parts:
        return None
    found = tuple(boxed(part, part.pose) for part in parts)
    low = tuple(min(p.low[k] for p in found) for k in range(3))
    high = tuple(max(p.high[k] for p in found) for k in range(3))
    return PlacedSolid(name, Pose((0.0, 0.0, 0.0), IDENTITY), found, low, high)  # type: ignore[arg-type]


def _apart(low: Vec, high: Vec, other_low: Vec, other_high: Vec, limit: float) -> bool:
    return (
        low[0] - other_high[0] > limit
        or other_low[0] - high[0] > limit
        or low[1] - other_high[1] > limit
        or other_low[1] - high[1] > limit
        or low[2] - other_high[2] > limit
        or other_low[2] - high[2] > limit
    )


def _geometry(part: Part) -> Any:
    """The shape as Coal has it."""
    if (solid := coal_solid(part.shape)) is not None:
        return solid
    if part.vertices is None:
        raise ValueError(f"a {type(part.shape).__name__} has no distance to anything")
    return coal_hull(part.vertices)


def _low_points(one: PlacedPart) -> list[Vec]:
    """Points of a part that are the first to be under uneven ground: its corners, or where round things are lowest."""
    m, (x, y, z) = one.pose.rotation, one.pose.position
    match one.part.shape:
        case Box((a, b, c)):
            corners = np.array([[i * a, j * b, k * c] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        case Cylinder(radius, half):
            turns = np.arange(8) * np.pi / 4
            ring = np.stack([radius * np.cos(turns), radius * np.sin(turns), np.zeros(8)], axis=1)
            corners = np.concatenate([ring + np.array([0, 0, half]), ring - np.array([0, 0, half])])
        case Capsule(radius, half):
            ends = (turned(m, (0.0, 0.0, half)), turned(m, (0.0, 0.0, -half)))
            return [(x + a, y + b, z + c - radius) for a, b, c in ends]
        case Sphere(radius):
            return [(x, y, z - radius)]
        case _:
            corners = one.part.vertices if one.part.vertices is not None else np.zeros((1, 3))
    here = [turned(m, (float(p[0]), float(p[1]), float(p[2]))) for p in corners]
    return [(x + a, y + b, z + c) for a, b, c in here]
