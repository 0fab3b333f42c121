"""Places that a relation to another thing says: beside it, on a side of it."""

from math import cos, pi, sin

from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import Matrix, PlacedSolid, Solid, Vec, heading
from anysim.placement.context import PlacementContext
from anysim.placement.sampler import PlacementSampler
from anysim_schemas.layout import PlaceFields
from anysim_schemas.relations import SIDES, SideSpec

SIDE_ANGLE = {"in_front_of": 0.0, "left_of": 0.5 * pi, "behind": pi, "right_of": -0.5 * pi}
"""The direction of each side against the x axis [rad]."""


def extent(placed: PlacedSolid, n: Vec) -> float:
    """How far a placed thing goes along a unit direction, from the world's origin."""
    values = [
        p.pose.position[0] * n[0]
        + p.pose.position[1] * n[1]
        + p.pose.position[2] * n[2]
        + p.part.reach(p.pose.rotation, n)
        for p in placed.parts
    ]
    return max(values) if values else sum(a * b for a, b in zip(placed.pose.position, n, strict=True))


def side_direction(side: str, relation: SideSpec, other: PlacedSolid) -> Vec:
    """The unit direction of a side of another thing."""
    angle = SIDE_ANGLE[side] + (heading(other.pose.rotation) if relation.axes == "own" else 0.0)
    return (cos(angle), sin(angle), 0.0)


def sideways(relation: SideSpec, other: PlacedSolid, n: Vec) -> tuple[float, float]:
    """The middle of another thing across a direction, and how far from it one may be."""
    across = (-n[1], n[0], 0.0)
    left, right = extent(other, across), -extent(other, (n[1], -n[0], 0.0))
    return 0.5 * (left + right), 0.5 * (left - right) if relation.lateral is None else relation.lateral


def spot_of(
    solid: Solid, rotation: Matrix, place: PlaceFields, sampler: PlacementSampler, context: PlacementContext
) -> tuple[G.Point | None, str]:
    """The place of the origin where something other than an area says it, and what does."""
    if place.x is not None or place.y is not None:
        x = 0.0 if place.x is None else float(sampler.value("x", place.x))
        y = 0.0 if place.y is None else float(sampler.value("y", place.y))
        return (x + context.origin[0], y + context.origin[1]), "point"
    for side in SIDES:
        relation: SideSpec | None = getattr(place, side)
        other = None if relation is None else context.find(relation.of)
        if relation is None or other is None:
            continue
        n = side_direction(side, relation, other)
        u, v = sampler.uniform(side, 2)
        low, high = relation.distance
        along = extent(other, n) + low + (high - low) * u + solid.reach(rotation, (-n[0], -n[1], 0.0))
        middle, free = sideways(relation, other, n)
        # the middle of the box, not the origin, is what stands beside the other
        shift = 0.5 * (solid.reach(rotation, (-n[1], n[0], 0.0)) - solid.reach(rotation, (n[1], -n[0], 0.0)))
        across = middle + free * (2 * v - 1) - shift
        return (along * n[0] - across * n[1], along * n[1] + across * n[0]), side
    if place.near is not None:
        other = context.find(place.near.of)
        if other is not None:
            u, v = sampler.uniform("near", 2)
            angle = 2 * pi * u
            n = (cos(angle), sin(angle), 0.0)
            low, high = place.near.distance
            cx, cy, _ = other.center
            far = extent(other, n) - (cx * n[0] + cy * n[1])
            along = far + low + (high - low) * v + solid.reach(rotation, (-n[0], -n[1], 0.0))
            return (cx + along * n[0], cy + along * n[1]), "near"
    return None, ""
