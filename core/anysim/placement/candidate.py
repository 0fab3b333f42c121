"""One candidate for a place: from what an entry says and the numbers that were drawn for it to a pose.

Used with the middle of all ranges for the World's initial poses, and with drawn numbers by the layout manager, which
also checks what is proposed here. Places are in the world frame; what an entry says is relative to the env's origin.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin
from typing import NamedTuple

from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import (
    Matrix,
    PlacedSolid,
    Pose,
    Quaternion,
    Solid,
    about_z,
    heading,
    matrix_of,
    quaternion_of,
    times,
    turn_about_z,
    turned,
)
from anysim.placement.context import Impossible, PlacementContext
from anysim.placement.relations import spot_of
from anysim.placement.sampler import PlacementSampler
from anysim.placement.standing_areas import StandingArea, below_area, height_under, region_of, standing_places
from anysim_schemas.layout import PlaceFields


class Candidate(NamedTuple):
    """A place: the root's pose, and on what it rests (None for a given position).

    `area` is the part of the plane that the origin may be in, for what was not drawn from it; None where all is.
    """

    pose: Pose
    quaternion: Quaternion
    placed: PlacedSolid
    support: PlacedSolid | None
    area: G.Area | None
    drawn_from: str


def candidate(
    solid: Solid, place: PlaceFields, sampler: PlacementSampler, context: PlacementContext
) -> Candidate | Impossible:
    """A pose for a solid, or why there is none."""
    base, turn = _turn(solid, place, sampler, context)
    quaternion = times(turn_about_z(turn), base)
    if place.position is not None:
        x, y, z = (float(v) for v in sampler.value("position", place.position))
        o = context.origin
        return _finished(solid, place, base, turn, (x + o[0], y + o[1]), z + o[2], None, None, "position", context)
    areas = standing_places(place, context)
    if isinstance(areas, Impossible):
        return areas
    rotation = matrix_of(quaternion)

    round_reach = _round_reach(solid, rotation) if place.facing is not None else None

    def reach(nx: float, ny: float) -> float:  # what is turned only later takes as much room as in any heading
        own = solid.reach(rotation, (nx, ny, 0.0)) if round_reach is None else round_reach
        return own - place.overhang

    region = region_of(place, context)
    under = below_area(place, context, reach)
    spot, drawn_from = spot_of(solid, rotation, place, sampler, context)
    if areas is None:  # on the ground
        area = region if under is None else under if region is None else G.common(region, under)
        if area is not None and not area:
            return Impossible(f"nothing of its region lies under '{place.under}'", hopeless=True)
        if spot is None:
            if area is None:
                spot, drawn_from = context.origin[:2], "origin"
            else:
                spot, drawn_from = G.point_in(area, *sampler.uniform("place", 3)), "area"
        return _finished(solid, place, base, turn, spot, None, None, area, drawn_from, context)
    if spot is None and not any(f.area for f in areas) and region is None and under is None:
        spot, drawn_from = areas[0].owner.pose.position[:2], "point"  # nothing level: over its origin
    if drawn_from == "point":  # x and y are taken as they are, also over an edge
        assert spot is not None
        return _finished(
            solid, place, base, turn, spot, height_under(areas, spot), areas[0].owner, region, drawn_from, context
        )
    fitting = [(f, tuple(p for p in (G.eroded(q, reach) for q in f.area) if p)) for f in areas]
    if region is not None:
        fitting = [(f, G.common(area, region)) for f, area in fitting]
    if under is not None:
        fitting = [(f, G.common(area, under)) for f, area in fitting]
    fitting = [(f, area) for f, area in fitting if area]
    if not fitting:
        return _no_room(place, areas, region)
    u, v, w = sampler.uniform("place", 3)
    sizes = [G.total(area) for _, area in fitting]
    wanted, chosen = u * sum(sizes), 0
    while chosen < len(sizes) - 1 and wanted > sizes[chosen]:
        wanted -= sizes[chosen]
        chosen += 1
    standing, area = fitting[chosen]
    if spot is None:
        share = wanted / sizes[chosen] if sizes[chosen] > 0 else 0.0
        spot, drawn_from = G.point_in(area, share, v, w), "area"
    return _finished(solid, place, base, turn, spot, standing.height, standing.owner, area, drawn_from, context)


def _round_reach(solid: Solid, rotation: Matrix) -> float:
    """How far a thing goes sideways from its origin, at most, whatever its heading."""
    x, y = (
        max(solid.reach(rotation, (a, b, 0.0)), solid.reach(rotation, (-a, -b, 0.0)))
        for a, b in ((1.0, 0.0), (0.0, 1.0))
    )
    return hypot(x, y)


def _turn(
    solid: Solid, place: PlaceFields, sampler: PlacementSampler, context: PlacementContext
) -> tuple[Quaternion, float]:
    """How it lies, and its turn about the vertical after that."""
    yaw = float(sampler.value("yaw", place.yaw))
    if place.aligned is not None:
        other = context.find(place.aligned.of)
        yaw += 0.0 if other is None else heading(other.pose.rotation)
    if place.rest == "given":
        roll, pitch = float(sampler.value("roll", place.roll)), float(sampler.value("pitch", place.pitch))
        return quaternion_of(roll, pitch, 0.0), yaw
    poses = context.resting(solid.name)
    pick, roll = sampler.uniform("rest", 2)
    chosen = poses[-1]
    for pose in poses:
        if pick < pose.share:
            chosen = pose
            break
        pick -= pose.share
    base = chosen.quaternion
    if chosen.rolls is not None:
        half = pi * roll
        ax, ay, az = chosen.rolls
        base = times(base, (ax * sin(half), ay * sin(half), az * sin(half), cos(half)))
    return base, yaw


def _finished(
    solid: Solid,
    place: PlaceFields,
    base: Quaternion,
    turn: float,
    spot: G.Point,
    height: float | None,
    support: PlacedSolid | None,
    area: G.Area | None,
    drawn_from: str,
    context: PlacementContext,
) -> Candidate:
    """With the alignment, the facing and the height that the place asks for; `height` None is that of the ground."""
    x, y = spot
    if place.aligned is not None and place.aligned.along is not None:
        x, y, drawn_from = _aligned(place, x, y, drawn_from, context)
    if place.facing is not None:
        target = _faced(place, context)
        if target is not None and hypot(target[0] - x, target[1] - y) > 1e-9:
            turn += atan2(target[1] - y, target[0] - x)
            drawn_from = "facing" if drawn_from == "area" else drawn_from
    quaternion = times(turn_about_z(turn), base)
    rotation = matrix_of(quaternion)
    if place.position is not None:
        assert height is not None
        z = height
    else:
        below = solid.reach(rotation, (0.0, 0.0, -1.0))
        if height is None:
            left, front = (solid.reach(rotation, (-a, -b, 0.0)) for a, b in ((1.0, 0.0), (0.0, 1.0)))
            right, back = (solid.reach(rotation, (a, b, 0.0)) for a, b in ((1.0, 0.0), (0.0, 1.0)))
            height = context.ground((x - left, y - front), (x + right, y + back))
        z = height + below
    pose = Pose((x, y, z), rotation)
    return Candidate(pose, quaternion, solid.at(pose), support, area, drawn_from)


def _aligned(
    place: PlaceFields, x: float, y: float, drawn_from: str, context: PlacementContext
) -> tuple[float, float, str]:
    """Moved onto the line through the other's origin."""
    aligned = place.aligned
    assert aligned is not None
    other = context.find(aligned.of)
    if other is None:
        return x, y, drawn_from
    axis = turned(about_z(heading(other.pose.rotation)), (1.0, 0.0, 0.0) if aligned.along == "x" else (0.0, 1.0, 0.0))
    ox, oy, _ = other.pose.position
    along = (x - ox) * axis[0] + (y - oy) * axis[1]
    ox, oy = ox - aligned.offset * axis[1], oy + aligned.offset * axis[0]
    return ox + along * axis[0], oy + along * axis[1], "aligned"


def _faced(place: PlaceFields, context: PlacementContext) -> G.Point | None:
    facing = place.facing
    assert facing is not None
    if facing.point is not None:
        return facing.point[0] + context.origin[0], facing.point[1] + context.origin[1]
    other = context.find(facing.of or "")
    return None if other is None else (other.center[0], other.center[1])


def _no_room(place: PlaceFields, areas: Sequence[StandingArea], region: G.Area | None) -> Impossible:
    owner = areas[0].owner.name
    if not any(f.area for f in areas):
        return Impossible(
            f"'{owner}' has no level surface on top to go on; give `x` and `y`, or say `in`", hopeless=True
        )
    (low, high) = G.bounds(tuple(p for f in areas for p in f.area))
    what = f"the surface of '{owner}', {high[0] - low[0]:.3g} by {high[1] - low[1]:.3g} m,"
    if region is not None:
        return Impossible(f"{what} and its region have no place in common where all of it stays on")
    return Impossible(f"{what} is too small to hold it; `overhang` allows it to stick out")
