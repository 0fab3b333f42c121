"""Level surfaces and regions in the world: where something may stand."""

from collections.abc import Callable, Iterable, Sequence
from math import inf
from typing import NamedTuple

from anysim.conventions import GROUND
from anysim.errors import listing
from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import PlacedSolid, heading
from anysim.placement.context import Impossible, PlacementContext, SettledObject
from anysim.placement.support_surfaces import SupportSurface, choose
from anysim_schemas.layout import PlaceFields
from anysim_schemas.regions import RegionSpec
from anysim_schemas.relations import SIDES


class StandingArea(NamedTuple):
    """A level surface in the world on which something may go: its height, outline, and owner."""

    height: float
    area: G.Area
    owner: PlacedSolid
    surface: SupportSurface


def standing_areas_of(reference: str, inside: bool, context: PlacementContext) -> list[StandingArea] | Impossible:
    """The level surfaces that a reference to a support means, in the world."""
    name, _, part = reference.partition(".")
    owner = context.find(name)
    if owner is None:
        return Impossible(f"'{name}' is not there in this env", hopeless=True)
    found = context.surfaces_of(owner)
    if part or not inside:
        chosen = choose(found, part, inside)
        kept = [] if chosen is None else [chosen]
    else:
        kept = [s for s in found if s.inner or s.headroom < inf]
    if not kept and (part or inside):
        names = listing([s.name for s in found]) if found else "none"
        what = f"no surface '{part}'" if part else "no inside with a level floor"
        return Impossible(f"'{name}' has {what} (surfaces: {names})", hopeless=True)
    yaw = heading(owner.pose.rotation) if _upright(owner) else 0.0
    x, y, z = owner.pose.position
    return [StandingArea(s.height + z, G.moved((s.polygon,), x, y, yaw), owner, s) for s in kept] or [
        StandingArea(owner.high[2], (), owner, SupportSurface("", -1, "", owner.high[2] - z, (), inf, False))
    ]


def _upright(placed: PlacedSolid) -> bool:
    return placed.pose.rotation[2][2] > 1.0 - 1e-9


def standing_places(place: PlaceFields, context: PlacementContext) -> list[StandingArea] | Impossible | None:
    """Where it may stand; None for the ground."""
    reference, inside = place.on, False
    if place.in_ is not None:
        reference, inside = place.in_, True
    if reference is None and place.under is None:
        for field in ("near", *SIDES):
            relation = getattr(place, field)
            if relation is None:
                continue
            found = context.support_of(relation.of)
            if found is None:
                return Impossible(
                    f"it is not known what '{relation.of}' rests on, so say what this rests on, with `on`",
                    hopeless=True,
                )
            reference, inside = found
            break
    if reference is None or reference == GROUND or context.find(reference.partition(".")[0]) is None:
        return None  # what it would rest on is not there in this env
    return standing_areas_of(reference, inside, context)


def height_under(areas: Sequence[StandingArea], spot: G.Point) -> float:
    """The height under a point: of the surface there, else of the owner's highest point."""
    heights = [f.height for f in areas if f.area and G.holds(f.area, *spot)]
    return max(heights) if heights else areas[0].owner.high[2]


def region_area(spec: RegionSpec, context: PlacementContext) -> G.Area:
    """A region in the world."""
    if spec.rectangle is not None:
        area: G.Area = (G.rectangle(*spec.rectangle),)
    elif spec.circle is not None:
        area = (G.disc(spec.circle.center, spec.circle.radius),)
    else:
        assert spec.polygon is not None
        area = G.convex_parts(spec.polygon)
    if spec.of is None:
        return G.moved(area, context.origin[0], context.origin[1], 0.0)
    owner = context.find(spec.of)
    if owner is None:
        return ()
    x, y, _ = owner.pose.position
    return G.moved(area, x, y, heading(owner.pose.rotation))


def region_of(place: PlaceFields, context: PlacementContext) -> G.Area | None:
    """The region of a place in the world; None where it has none."""
    if place.region is None:
        return None
    return region_area(place.region if isinstance(place.region, RegionSpec) else context.region(place.region), context)


def below_area(place: PlaceFields, context: PlacementContext, reach: Callable[[float, float], float]) -> G.Area | None:
    """Below the box around the other object, wholly where there is the room."""
    if place.under is None:
        return None
    other = context.find(place.under)
    if other is None:
        return ()
    outline = G.rectangle(other.low[:2], other.high[:2])
    inner = G.eroded(outline, reach)
    return (inner or outline,)


def free_area(areas: Sequence[StandingArea], settled: Iterable[SettledObject]) -> tuple[float, float]:
    """[m^2] of surfaces, and of what has no box of anything else over it, counted on a grid of 32 by 32 points."""
    placed = [one.placed for one in settled]
    whole = free = 0.0
    for standing in areas:
        own, level = standing.owner.name, standing.height
        boxes = [p for p in placed if p.name != own and p.low[2] < level + 0.02 and p.high[2] > level]
        (x0, y0), (x1, y1) = G.bounds(standing.area)
        points = [
            (x0 + (i + 0.5) / 32 * (x1 - x0), y0 + (j + 0.5) / 32 * (y1 - y0)) for i in range(32) for j in range(32)
        ]
        inside = [p for p in points if G.holds(standing.area, *p)]
        bare = [
            p for p in inside if not any(b.low[0] <= p[0] <= b.high[0] and b.low[1] <= p[1] <= b.high[1] for b in boxes)
        ]
        size = G.total(standing.area)
        whole, free = whole + size, free + size * len(bare) / max(1, len(inside))
    return whole, free
