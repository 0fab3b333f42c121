"""One candidate for a place: from what an entry says and the numbers that were drawn for it to a pose.

Used with the middle of all ranges for the World's initial poses, and with drawn numbers by the layout manager, which
also checks what is proposed here. Places are in the world frame; what an entry says is relative to the env's origin.
"""

from collections.abc import Callable, Sequence
from math import atan2, cos, hypot, inf, pi, sin
from typing import Any, NamedTuple, Protocol

from anysim.conventions import GROUND
from anysim.errors import listing
from anysim.world import polygons as G
from anysim.world.solid import Matrix, Placed, Pose, Solid, Vec, about_z, heading, matrix_of, turned
from anysim.world.stable import RestingPose
from anysim.world.supports import SupportSurface, choose
from anysim_schemas.layout import PlaceFields
from anysim_schemas.regions import RegionSpec
from anysim_schemas.relations import SIDES, SideSpec

Quaternion = tuple[float, float, float, float]
SIDE_ANGLE = {"in_front_of": 0.0, "left_of": 0.5 * pi, "behind": pi, "right_of": -0.5 * pi}
"""The direction of each side against the x axis [rad]."""


class Dice(Protocol):
    """Where the numbers come from."""

    def value(self, field: str, value: Any) -> Any:
        """A field of the entry, drawn."""
        ...

    def uniform(self, purpose: str, count: int) -> Sequence[float]:
        """Numbers in [0, 1) for one purpose."""
        ...


class Around(Protocol):
    """What is there already, for who is being placed."""

    origin: Vec

    def find(self, name: str) -> Placed | None:
        """An object or a robot by name; None where it is not there."""
        ...

    def surfaces_of(self, placed: Placed) -> Sequence[SupportSurface]:
        """The surfaces of a placed thing, in the frame of its root as it is turned, but for its heading."""
        ...

    def ground(self, low: G.Point, high: G.Point) -> float:
        """The greatest height of the ground under a rectangle."""
        ...

    def support_of(self, name: str) -> tuple[str, bool] | None:
        """What a placed thing rests on, and whether inside of it; None where its position was given."""
        ...

    def region(self, name: str) -> RegionSpec:
        """A region by name."""
        ...


class Impossible(NamedTuple):
    """Why there is no candidate. `hopeless` where no draw would help."""

    reason: str
    hopeless: bool = False


class Candidate(NamedTuple):
    """A place: the root's pose, and on what it rests (None for a given position).

    `area` is the part of the plane that the origin may be in, for what was not drawn from it; None where all is.
    """

    pose: Pose
    quaternion: Quaternion
    placed: Placed
    support: Placed | None
    area: G.Area | None
    drawn_from: str


class Footing(NamedTuple):
    """A level surface in the world on which something may go: its height, outline, and owner."""

    height: float
    area: G.Area
    owner: Placed
    surface: SupportSurface


def quaternion_of(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Fixed-axis roll, then pitch, then yaw."""
    sr, cr, sp, cp = sin(0.5 * roll), cos(0.5 * roll), sin(0.5 * pitch), cos(0.5 * pitch)
    sy, cy = sin(0.5 * yaw), cos(0.5 * yaw)
    return (
        sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy,
    )  # fmt: skip


def times(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation b first, then a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz,
    )  # fmt: skip


def candidate(
    solid: Solid, place: PlaceFields, resting: Callable[[], Sequence[RestingPose]], dice: Dice, around: Around
) -> Candidate | Impossible:
    """A pose for a solid, or why there is none."""
    base, turn = _turn(place, resting, dice, around)
    quaternion = times(_about_z(turn), base)
    if place.position is not None:
        x, y, z = (float(v) for v in dice.value("position", place.position))
        o = around.origin
        return _finished(solid, place, base, turn, (x + o[0], y + o[1]), z + o[2], None, None, "position", around)
    footings = _footings(place, around)
    if isinstance(footings, Impossible):
        return footings
    rotation = matrix_of(quaternion)

    round_reach = _round_reach(solid, rotation) if place.facing is not None else None

    def reach(nx: float, ny: float) -> float:  # what is turned only later takes as much room as in any heading
        own = solid.reach(rotation, (nx, ny, 0.0)) if round_reach is None else round_reach
        return own - place.overhang

    region = _region(place, around)
    under = _under(place, around, reach)
    spot, drawn_from = _spot(solid, rotation, place, dice, around)
    if footings is None:  # on the ground
        area = region if under is None else under if region is None else G.common(region, under)
        if area is not None and not area:
            return Impossible(f"nothing of its region lies under '{place.under}'", hopeless=True)
        if spot is None:
            if area is None:
                spot, drawn_from = around.origin[:2], "origin"
            else:
                spot, drawn_from = G.point_in(area, *dice.uniform("place", 3)), "area"
        return _finished(solid, place, base, turn, spot, None, None, area, drawn_from, around)
    if spot is None and not any(f.area for f in footings) and region is None and under is None:
        spot, drawn_from = footings[0].owner.pose.position[:2], "point"  # nothing level: over its origin
    if drawn_from == "point":  # x and y are taken as they are, also over an edge
        assert spot is not None
        return _finished(solid, place, base, turn, spot, _under_point(footings, spot), footings[0].owner, region,
                         drawn_from, around)  # fmt: skip
    fitting = [(f, tuple(p for p in (G.eroded(q, reach) for q in f.area) if p)) for f in footings]
    if region is not None:
        fitting = [(f, G.common(area, region)) for f, area in fitting]
    if under is not None:
        fitting = [(f, G.common(area, under)) for f, area in fitting]
    fitting = [(f, area) for f, area in fitting if area]
    if not fitting:
        return _no_room(place, footings, region)
    u, v, w = dice.uniform("place", 3)
    sizes = [G.total(area) for _, area in fitting]
    wanted, chosen = u * sum(sizes), 0
    while chosen < len(sizes) - 1 and wanted > sizes[chosen]:
        wanted -= sizes[chosen]
        chosen += 1
    footing, area = fitting[chosen]
    if spot is None:
        share = wanted / sizes[chosen] if sizes[chosen] > 0 else 0.0
        spot, drawn_from = G.point_in(area, share, v, w), "area"
    return _finished(solid, place, base, turn, spot, footing.height, footing.owner, area, drawn_from, around)


def _round_reach(solid: Solid, rotation: Matrix) -> float:
    """How far a thing goes sideways from its origin, at most, whatever its heading."""
    x, y = (max(solid.reach(rotation, (a, b, 0.0)), solid.reach(rotation, (-a, -b, 0.0)))
            for a, b in ((1.0, 0.0), (0.0, 1.0)))  # fmt: skip
    return hypot(x, y)


def _about_z(angle: float) -> Quaternion:
    return (0.0, 0.0, sin(0.5 * angle), cos(0.5 * angle))


def _turn(
    place: PlaceFields, resting: Callable[[], Sequence[RestingPose]], dice: Dice, around: Around
) -> tuple[Quaternion, float]:
    """How it lies, and its turn about the vertical after that."""
    yaw = float(dice.value("yaw", place.yaw))
    if place.aligned is not None:
        other = around.find(place.aligned.of)
        yaw += 0.0 if other is None else heading(other.pose.rotation)
    if place.rest == "given":
        roll, pitch = float(dice.value("roll", place.roll)), float(dice.value("pitch", place.pitch))
        return quaternion_of(roll, pitch, 0.0), yaw
    poses = resting()
    pick, roll = dice.uniform("rest", 2)
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


def footings_of(reference: str, inside: bool, around: Around) -> list[Footing] | Impossible:
    """The level surfaces that a reference to a support means, in the world."""
    name, _, part = reference.partition(".")
    owner = around.find(name)
    if owner is None:
        return Impossible(f"'{name}' is not there in this env", hopeless=True)
    found = around.surfaces_of(owner)
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
    return [Footing(s.height + z, G.moved((s.polygon,), x, y, yaw), owner, s) for s in kept] or [
        Footing(owner.high[2], (), owner, SupportSurface("", -1, "", owner.high[2] - z, (), inf, False))
    ]


def _upright(placed: Placed) -> bool:
    return placed.pose.rotation[2][2] > 1.0 - 1e-9


def _footings(place: PlaceFields, around: Around) -> list[Footing] | Impossible | None:
    """Where it may stand; None for the ground."""
    reference, inside = place.on, False
    if place.in_ is not None:
        reference, inside = place.in_, True
    if reference is None and place.under is None:
        for field in ("near", *SIDES):
            relation = getattr(place, field)
            if relation is None:
                continue
            found = around.support_of(relation.of)
            if found is None:
                return Impossible(
                    f"it is not known what '{relation.of}' rests on, so say what this rests on, with `on`", hopeless=True
                )
            reference, inside = found
            break
    if reference is None or reference == GROUND:
        return None
    return footings_of(reference, inside, around)


def _under_point(footings: Sequence[Footing], spot: G.Point) -> float:
    """The height under a point: of the surface there, else of the owner's highest point."""
    heights = [f.height for f in footings if f.area and G.holds(f.area, *spot)]
    return max(heights) if heights else footings[0].owner.high[2]


def region_area(spec: RegionSpec, around: Around) -> G.Area:
    """A region in the world."""
    if spec.rectangle is not None:
        area: G.Area = (G.rectangle(*spec.rectangle),)
    elif spec.circle is not None:
        area = (G.disc(spec.circle.center, spec.circle.radius),)
    else:
        assert spec.polygon is not None
        area = G.convex_parts(spec.polygon)
    if spec.of is None:
        return G.moved(area, around.origin[0], around.origin[1], 0.0)
    owner = around.find(spec.of)
    if owner is None:
        return ()
    x, y, _ = owner.pose.position
    return G.moved(area, x, y, heading(owner.pose.rotation))


def _region(place: PlaceFields, around: Around) -> G.Area | None:
    if place.region is None:
        return None
    return region_area(place.region if isinstance(place.region, RegionSpec) else around.region(place.region), around)


def _under(place: PlaceFields, around: Around, reach: Callable[[float, float], float]) -> G.Area | None:
    """Below the box around the other object, wholly where there is the room."""
    if place.under is None:
        return None
    other = around.find(place.under)
    if other is None:
        return ()
    outline = G.rectangle(other.low[:2], other.high[:2])
    inner = G.eroded(outline, reach)
    return (inner or outline,)


def extent(placed: Placed, n: Vec) -> float:
    """How far a placed thing goes along a unit direction, from the world's origin."""
    values = [
        p.pose.position[0] * n[0] + p.pose.position[1] * n[1] + p.pose.position[2] * n[2] + p.part.reach(p.pose.rotation, n)
        for p in placed.parts
    ]
    return max(values) if values else sum(a * b for a, b in zip(placed.pose.position, n, strict=True))


def side_direction(side: str, relation: SideSpec, other: Placed) -> Vec:
    """The unit direction of a side of another thing."""
    angle = SIDE_ANGLE[side] + (heading(other.pose.rotation) if relation.axes == "own" else 0.0)
    return (cos(angle), sin(angle), 0.0)


def sideways(relation: SideSpec, other: Placed, n: Vec) -> tuple[float, float]:
    """The middle of another thing across a direction, and how far from it one may be."""
    across = (-n[1], n[0], 0.0)
    left, right = extent(other, across), -extent(other, (n[1], -n[0], 0.0))
    return 0.5 * (left + right), 0.5 * (left - right) if relation.lateral is None else relation.lateral


def _spot(
    solid: Solid, rotation: Matrix, place: PlaceFields, dice: Dice, around: Around
) -> tuple[G.Point | None, str]:  # fmt: skip
    """The place of the origin where something other than an area says it, and what does."""
    if place.x is not None or place.y is not None:
        x = 0.0 if place.x is None else float(dice.value("x", place.x))
        y = 0.0 if place.y is None else float(dice.value("y", place.y))
        return (x + around.origin[0], y + around.origin[1]), "point"
    for side in SIDES:
        relation = getattr(place, side)
        other = None if relation is None else around.find(relation.of)
        if other is None:
            continue
        n = side_direction(side, relation, other)
        u, v = dice.uniform(side, 2)
        low, high = relation.distance
        along = extent(other, n) + low + (high - low) * u + solid.reach(rotation, (-n[0], -n[1], 0.0))
        middle, free = sideways(relation, other, n)
        # the middle of the box, not the origin, is what stands beside the other
        shift = 0.5 * (solid.reach(rotation, (-n[1], n[0], 0.0)) - solid.reach(rotation, (n[1], -n[0], 0.0)))
        across = middle + free * (2 * v - 1) - shift
        return (along * n[0] - across * n[1], along * n[1] + across * n[0]), side
    if place.near is not None:
        other = around.find(place.near.of)
        if other is not None:
            u, v = dice.uniform("near", 2)
            angle = 2 * pi * u
            n = (cos(angle), sin(angle), 0.0)
            low, high = place.near.distance
            cx, cy, _ = other.center
            far = extent(other, n) - (cx * n[0] + cy * n[1])
            along = far + low + (high - low) * v + solid.reach(rotation, (-n[0], -n[1], 0.0))
            return (cx + along * n[0], cy + along * n[1]), "near"
    return None, ""


def _finished(
    solid: Solid, place: PlaceFields, base: Quaternion, turn: float, spot: G.Point, height: float | None,
    support: Placed | None, area: G.Area | None, drawn_from: str, around: Around,
) -> Candidate:  # fmt: skip
    """With the alignment, the facing and the height that the place asks for; `height` None is that of the ground."""
    x, y = spot
    if place.aligned is not None and place.aligned.along is not None:
        x, y, drawn_from = _aligned(place, x, y, drawn_from, around)
    if place.facing is not None:
        target = _faced(place, around)
        if target is not None and hypot(target[0] - x, target[1] - y) > 1e-9:
            turn += atan2(target[1] - y, target[0] - x)
            drawn_from = "facing" if drawn_from == "area" else drawn_from
    quaternion = times(_about_z(turn), base)
    rotation = matrix_of(quaternion)
    if place.position is not None:
        assert height is not None
        z = height
    else:
        below = solid.reach(rotation, (0.0, 0.0, -1.0))
        if height is None:
            left, front = (solid.reach(rotation, (-a, -b, 0.0)) for a, b in ((1.0, 0.0), (0.0, 1.0)))
            right, back = (solid.reach(rotation, (a, b, 0.0)) for a, b in ((1.0, 0.0), (0.0, 1.0)))
            height = around.ground((x - left, y - front), (x + right, y + back))
        z = height + below
    pose = Pose((x, y, z), rotation)
    return Candidate(pose, quaternion, solid.at(pose), support, area, drawn_from)


def _aligned(place: PlaceFields, x: float, y: float, drawn_from: str, around: Around) -> tuple[float, float, str]:
    """Moved onto the line through the other's origin."""
    aligned = place.aligned
    assert aligned is not None
    other = around.find(aligned.of)
    if other is None:
        return x, y, drawn_from
    axis = turned(about_z(heading(other.pose.rotation)), (1.0, 0.0, 0.0) if aligned.along == "x" else (0.0, 1.0, 0.0))
    ox, oy, _ = other.pose.position
    along = (x - ox) * axis[0] + (y - oy) * axis[1]
    ox, oy = ox - aligned.offset * axis[1], oy + aligned.offset * axis[0]
    return ox + along * axis[0], oy + along * axis[1], "aligned"


def _faced(place: PlaceFields, around: Around) -> G.Point | None:
    facing = place.facing
    assert facing is not None
    if facing.point is not None:
        return facing.point[0] + around.origin[0], facing.point[1] + around.origin[1]
    other = around.find(facing.of or "")
    return None if other is None else (other.center[0], other.center[1])


def _no_room(place: PlaceFields, footings: Sequence[Footing], region: G.Area | None) -> Impossible:
    owner = footings[0].owner.name
    if not any(f.area for f in footings):
        return Impossible(f"'{owner}' has no level surface on top to go on; give `x` and `y`, or say `in`", hopeless=True)
    (low, high) = G.bounds(tuple(p for f in footings for p in f.area))
    what = f"the surface of '{owner}', {high[0] - low[0]:.3g} by {high[1] - low[1]:.3g} m,"
    if region is not None:
        return Impossible(f"{what} and its region have no place in common where all of it stays on")
    return Impossible(f"{what} is too small to hold it; `overhang` allows it to stick out")
