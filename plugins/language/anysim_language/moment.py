"""Moments of an episode as language sees them: where things are in whole millimetres, whatever a float's last bit."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.shapes import Box, Cylinder, Shape, is_ground
from anysim.model.world import World
from anysim_language.things import Thing

Point = tuple[int, int, int]
UPRIGHT = 0.999
"""The cosine from which on a shape's z counts as vertical."""


class Extent(NamedTuple):
    """The box around something along the world's axes [mm]."""

    low: Point
    high: Point

    @property
    def centre(self) -> Point:
        """Its middle, rounded down [mm]."""
        x, y, z = ((a + b) // 2 for a, b in zip(self.low, self.high, strict=True))
        return x, y, z


class Piece(NamedTuple):
    """One shape of a body: the box around it, and where it is."""

    box: Extent
    shape: Shape
    pose: Array

    def depth(self, x: int, y: int) -> int:
        """How far [mm] a point of the plane is within its outline, seen from above; not positive outside.

        Exact for boxes that stand on a face and for upright cylinders; of the box around it for all others.
        """
        up = P.rotate(self.pose[3:], np.array([0.0, 0.0, 1.0]))
        if abs(float(up[2])) > UPRIGHT and isinstance(self.shape, Box | Cylinder):
            offset = np.array([x / 1000.0 - self.pose[0], y / 1000.0 - self.pose[1], 0.0])
            local = P.rotate(P.conjugate(self.pose[3:]), offset)
            if isinstance(self.shape, Box):
                return int(1000.0 * min(self.shape.half_size[i] - abs(float(local[i])) for i in (0, 1)))
            return int(1000.0 * (self.shape.radius - float(np.hypot(local[0], local[1]))))
        low, high = self.box
        return min(x - low[0], high[0] - x, y - low[1], high[1] - y)


def millimetres(values: Array) -> Point:
    """A point [m] in whole millimetres."""
    x, y, z = (int(np.floor(float(v) * 1000.0 + 0.5)) for v in values)
    return x, y, z


@dataclass(frozen=True)
class Viewer:
    """Who looks: a robot as it stood at the beginning, or nobody, who looks along x from the origin."""

    name: str
    position: Point
    forward: tuple[int, int]
    """The direction of view on the ground, in thousandths."""

    def lateral(self, a: Point) -> int:
        """How far to the left something is [mm]."""
        (fx, fy), (x, y, _) = self.forward, self.position
        return ((a[1] - y) * fx - (a[0] - x) * fy) // 1000

    def ahead(self, a: Point) -> int:
        """How far away along the view something is [mm]."""
        (fx, fy), (x, y, _) = self.forward, self.position
        return ((a[0] - x) * fx + (a[1] - y) * fy) // 1000


class Moment:
    """The things of an env at one control step, where their bodies are.

    Attributes:
        things: all that are there.
        poses: (B, 7) of all bodies [m].
        step: the control step, 0 right after the reset.
    """

    def __init__(self, world: World, things: tuple[Thing, ...], viewer: Viewer, poses: Array, step: int) -> None:
        self.world, self.things, self.viewer, self.poses, self.step = world, things, viewer, poses, step
        self.meshes = {mesh.name: mesh for mesh in world.meshes}
        self._extents: dict[str, Extent] = {}
        self._pieces: dict[int, list[Piece]] = {}

    @cached_property
    def by_name(self) -> dict[str, Thing]:
        """The things by their logical names."""
        return {thing.name: thing for thing in self.things}

    @cached_property
    def objects(self) -> tuple[Thing, ...]:
        """All but robots and rooms."""
        return tuple(
            t for t in self.things if not t.robot and not self.world.entities[t.entity].source.startswith("room:")
        )

    def extent(self, name: str) -> Extent:
        """The box around a thing; around its base alone for a robot, whose posture changes."""
        if name not in self._extents:
            thing = self.by_name[name]
            entity = self.world.entities[thing.entity]
            bodies = (entity.root,) if thing.robot else range(entity.body_start, entity.body_stop)
            boxes = [piece.box for body in bodies for piece in self.pieces(body)]
            if not boxes:
                at = millimetres(self.poses[entity.root, :3])
                boxes = [Extent(at, at)]
            low = np.min([box.low for box in boxes], axis=0)
            high = np.max([box.high for box in boxes], axis=0)
            self._extents[name] = Extent(_point(low), _point(high))
        return self._extents[name]

    def pieces(self, body: int) -> list[Piece]:
        """The shapes that a body collides with, or, where that is nothing, what is seen of it."""
        if body in self._pieces:
            return self._pieces[body]
        geoms = [self.world.geoms[g] for g in self.world.body_geoms[body]]
        solid = [g for g in geoms if not is_ground(g.shape)]
        found = self._pieces.setdefault(body, [])
        for geom in [g for g in solid if g.collides] or solid:
            pose = P.compose(self.poses[body], P.pose(geom.position, geom.quaternion))
            low, high = shape_bounds(geom.shape, pose, self.meshes)
            found.append(Piece(Extent(millimetres(low), millimetres(high)), geom.shape, pose))
        return found

    def at(self, name: str) -> Point:
        """The middle of a thing [mm]."""
        return self.extent(name).centre


def _point(values: Array) -> Point:
    x, y, z = (int(v) for v in values)
    return x, y, z


def viewer_of(world: World, things: tuple[Thing, ...], poses: Array) -> Viewer:
    """The first robot where it stands in `poses` (B, 7), looking along its x; nobody in a world without robots."""
    for thing in things:
        if thing.robot:
            pose = poses[world.entities[thing.entity].root]
            ahead = P.rotate(pose[3:], np.array([1.0, 0.0, 0.0]))
            length = float(np.hypot(ahead[0], ahead[1])) or 1.0
            forward = (int(np.floor(1000.0 * ahead[0] / length + 0.5)), int(np.floor(1000.0 * ahead[1] / length + 0.5)))
            return Viewer(thing.name, millimetres(pose[:3]), forward)
    return Viewer("", (0, 0, 0), (1000, 0))
