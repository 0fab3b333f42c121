"""Surfaces that things can stand on: upward faces of boxes, cylinders and hulls, with the room above them.

A surface has a name: `top` for what is open above, `shelf_1`, `shelf_2`, … from the bottom for what has something
above it, `inside` for the floor of something open that walls surround. The largest of several of a kind has the bare
name, the others a number. A surface also goes by the name of the link that it is on.
"""

from collections.abc import Sequence
from math import cos, inf, radians
from typing import NamedTuple

import numpy as np

from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import IDENTITY, Matrix, PlacedPart, Pose, Solid, turned
from anysim.model.world import Box, Cylinder, World

LEVEL = cos(radians(5.0))
"""How much of an upward normal must be upward."""

HEADROOM = 0.02
"""Free height [m] above a surface from which on something may stand there."""

SMALLEST = 1e-4
"""[m^2] of the smallest surface."""

FLAT = 0.2
"""Share of the box around a hull, seen from above, that its level top must have: the summit of a bump is no surface."""

SAMPLES = 8
"""Points along each side of a surface at which the room above it is measured."""


class SupportSurface(NamedTuple):
    """A level face, seen from the root frame (which stands upright, or is turned as it was when this was found).

    `polygon` is convex, `height` that of its highest point, `headroom` the free height above most of it, infinite
    where it is open; `inner` says that walls stand around it. `body` is the link it is on.
    """

    name: str
    body: int
    link: str
    height: float
    polygon: G.Polygon
    headroom: float
    inner: bool

    @property
    def size(self) -> float:
        """[m^2]."""
        return G.size(self.polygon)


def surfaces(world: World, solid: Solid, rotation: Matrix = IDENTITY) -> tuple[SupportSurface, ...]:
    """The surfaces of an entity whose root is turned by `rotation`, the largest first, with their names."""
    placed = solid.at(Pose((0.0, 0.0, 0.0), rotation)).parts
    found: list[SupportSurface] = []
    for number, one in enumerate(placed):
        others = [other for k, other in enumerate(placed) if k != number]
        for height, polygon in _faces(one):
            headroom = _headroom(height, polygon, others)
            if headroom >= HEADROOM:
                link = world.bodies[one.part.body].name.rpartition(".")[2]
                found.append(
                    SupportSurface("", one.part.body, link, height, polygon, headroom, _walled(height, polygon, others))
                )
    return _named(found)


def _faces(one: PlacedPart) -> list[tuple[float, G.Polygon]]:
    """The level upward faces of a placed part: height and outline."""
    (cx, cy, cz), m = one.pose
    shape = one.part.shape
    if isinstance(shape, Box):
        return _box_faces(shape, one)
    if isinstance(shape, Cylinder):
        up = m[2][2]
        if abs(up) < LEVEL:
            return []
        side = shape.half_length if up > 0 else -shape.half_length
        x, y, _ = turned(m, (0.0, 0.0, side))
        return [(one.high[2], G.disc((cx + x, cy + y), shape.radius))]
    if one.part.vertices is None:
        return []
    v = one.part.vertices
    world = [v[:, 0] * row[0] + v[:, 1] * row[1] + v[:, 2] * row[2] for row in m]
    top = one.high[2]
    thickness = max(1e-3, 0.01 * (one.high[2] - one.low[2]))
    level = world[2] + cz >= top - thickness  # the top face of a hull, however many facets make it
    outline = G.hull([(cx + float(a), cy + float(b)) for a, b in zip(world[0][level], world[1][level], strict=True)])
    if len(outline) < 3:
        return []
    footprint = (one.high[0] - one.low[0]) * (one.high[1] - one.low[1])
    return [(top, outline)] if G.size(outline) >= max(SMALLEST, FLAT * footprint) else []


def _box_faces(shape: Box, one: PlacedPart) -> list[tuple[float, G.Polygon]]:
    (cx, cy, _), m = one.pose
    for axis in range(3):
        up = m[2][axis]
        if abs(up) < LEVEL:
            continue
        side = 1.0 if up > 0 else -1.0
        a, b = [k for k in range(3) if k != axis]
        corners: list[G.Point] = []
        for sa, sb in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            local = [0.0, 0.0, 0.0]
            local[axis], local[a], local[b] = (
                side * shape.half_size[axis],
                sa * shape.half_size[a],
                sb * shape.half_size[b],
            )
            x, y, _ = turned(m, (local[0], local[1], local[2]))
            corners.append((cx + x, cy + y))
        outline = tuple(corners) if G.size(tuple(corners)) > 0 else tuple(reversed(corners))
        return [(one.high[2], outline)] if G.size(outline) >= SMALLEST else []
    return []


def _headroom(height: float, polygon: G.Polygon, others: Sequence[PlacedPart]) -> float:
    """The free height above the middling point of a surface; 0 where something covers most of it."""
    above = [o for o in others if o.high[2] > height + 1e-3]
    if not above:
        return inf
    (x0, y0), (x1, y1) = G.bounds((polygon,))
    steps = [(k + 0.5) / SAMPLES for k in range(SAMPLES)]
    free: list[float] = []
    for u in steps:
        for v in steps:
            x, y = x0 + u * (x1 - x0), y0 + v * (y1 - y0)
            if G.holds((polygon,), x, y):
                over = [o.low[2] - height for o in above if _over(o, x, y)]
                free.append(max(0.0, min(over, default=inf)))
    return float(sorted(free)[len(free) // 2]) if free else 0.0


def _over(part: PlacedPart, x: float, y: float) -> bool:
    return part.low[0] <= x <= part.high[0] and part.low[1] <= y <= part.high[1]


def _walled(height: float, polygon: G.Polygon, others: Sequence[PlacedPart]) -> bool:
    """Whether something rises above the surface on at least three of its four sides."""
    x, y = G.center((polygon,))
    walls = [o for o in others if o.low[2] < height + HEADROOM and o.high[2] > height + HEADROOM]
    across = [o for o in walls if o.low[1] <= y <= o.high[1]]
    along = [o for o in walls if o.low[0] <= x <= o.high[0]]
    sides = (
        any(o.low[0] > x for o in across), any(o.high[0] < x for o in across),
        any(o.low[1] > y for o in along), any(o.high[1] < y for o in along),
    )  # fmt: skip
    return sum(sides) >= 3


def _named(found: list[SupportSurface]) -> tuple[SupportSurface, ...]:
    shelves = sorted((s for s in found if np.isfinite(s.headroom)), key=lambda s: (s.height, s.polygon))
    named = [s._replace(name=f"shelf_{k + 1}") for k, s in enumerate(shelves)]
    for kind, inner in (("inside", True), ("top", False)):
        of_kind = [s for s in found if not np.isfinite(s.headroom) and s.inner == inner]
        ordered = sorted(of_kind, key=lambda s: (-round(s.size, 9), -s.height, s.polygon))
        named += [s._replace(name=kind if k == 0 else f"{kind}_{k + 1}") for k, s in enumerate(ordered)]
    return tuple(sorted(named, key=lambda s: (-round(s.size, 9), -s.height, s.name)))


def choose(found: Sequence[SupportSurface], part: str, inside: bool) -> SupportSurface | None:
    """The surface that is meant: by its name or its link's, else the largest top, or the largest inner one."""
    if part:
        exact = [s for s in found if s.name == part]
        on_link = [s for s in found if s.link == part]
        inner = [s for s in on_link if s.inner or np.isfinite(s.headroom)]
        return next(iter(exact or (inner if inside else []) or on_link), None)
    if inside:
        return next((s for s in found if s.inner or np.isfinite(s.headroom)), None)
    return next((s for s in found if s.name == "top"), None)
