"""The repair of proposed poses: dropped onto its support, turned upright, pushed out of others, within bounds."""

from collections.abc import Callable
from math import acos, cos, pi, sin

from anysim.geometry import polygon as G
from anysim.geometry.convex_parts import Pose, Quaternion, heading, matrix_of, turn_about_z
from anysim.placement.candidate import Candidate
from anysim.placement.constraints import PlacementTask
from anysim.placement.context import Impossible, PlacementContext
from anysim.placement.packing import shifted
from anysim.placement.standing_areas import region_of, standing_areas_of
from anysim_schemas.layout import RepairSpec
from anysim_schemas.proposals import ProposedPose

SNUG = 1e-6
"""[m] and [rad] of repair that is none."""


def start(
    task: PlacementTask, proposed: ProposedPose, bounds: RepairSpec, context: PlacementContext
) -> Candidate | str:
    """The pose as proposed, upright and on its support within the bounds; else why not, in words after its name."""
    place = task.place
    quaternion = _orientation(proposed, bounds)
    x, y, z = (a + b for a, b in zip(proposed.position, context.origin, strict=True))
    pose = Pose((x, y, z), matrix_of(quaternion))
    found = Candidate(pose, quaternion, task.solid.at(pose), None, region_of(place, context), "proposal")
    reference, inside = (place.in_, True) if place.in_ is not None else (place.on, False)
    if place.position is not None:
        return found
    if reference is None or reference == "terrain":
        low, high = found.placed.low, found.placed.high
        height, owner = context.ground(low[:2], high[:2]), None
    else:
        surfaces = standing_areas_of(reference, inside, context)
        if isinstance(surfaces, Impossible):
            return f"cannot be placed: {surfaces.reason}"
        under = [f for f in surfaces if not f.area or G.holds(f.area, x, y)]
        if not under:
            (x0, y0), (x1, y1) = G.bounds(tuple(p for f in surfaces for p in f.area))
            return (
                f"is proposed at x {x:.3g}, y {y:.3g}, which is not above '{reference}' "
                f"(x {x0:.3g} to {x1:.3g}, y {y0:.3g} to {y1:.3g})"
            )
        nearest = min(under, key=lambda f: abs(f.height - found.placed.low[2]))
        height, owner = nearest.height, nearest.owner
    drop = height - found.placed.low[2]
    if abs(drop) > bounds.drop + SNUG:
        side = "above" if drop < 0 else "below"
        return f"is proposed {abs(drop):.3g} m {side} its support, more than the {bounds.drop:g} m that it may be moved"
    return shifted(found, 0.0, 0.0, drop)._replace(support=owner)


def repaired(found: Candidate, bounds: RepairSpec, objection: Callable[[Candidate], str | None]) -> Candidate | str:
    """The nearest place beside the proposed one to which nothing objects; else the objection to the proposed one."""
    first: str | None = None
    for dx, dy in _nudges(bounds.distance):
        moved = shifted(found, dx, dy) if dx or dy else found
        wrong = objection(moved)
        if wrong is None:
            return moved
        first = first or wrong
    return first or ""


def _orientation(proposed: ProposedPose, bounds: RepairSpec) -> Quaternion:
    """As proposed; a tilt that is within the bounds is taken for a slip, and the thing set upright."""
    if proposed.quaternion is None:
        return turn_about_z(proposed.yaw)
    length = sum(c * c for c in proposed.quaternion) ** 0.5
    x, y, z, w = (c / length for c in proposed.quaternion)
    rotation = matrix_of((x, y, z, w))
    tilt = acos(max(-1.0, min(1.0, rotation[2][2])))
    if tilt > bounds.angle:
        return (x, y, z, w)
    return turn_about_z(heading(rotation))


def _nudges(distance: float) -> list[tuple[float, float]]:
    """Sideways shifts to try, the smallest first: rings of growing radius up to `distance` [m]."""
    found = [(0.0, 0.0)]
    for ring in (0.1, 0.2, 0.35, 0.5, 0.75, 1.0):
        count = 8 if ring < 0.5 else 16
        found += [
            (ring * distance * cos(2 * pi * k / count), ring * distance * sin(2 * pi * k / count)) for k in range(count)
        ]
    return found if distance > 0 else found[:1]
