"""Places of furniture: along walls, at tables, in the open, never before doors, with paths left between the doors.

Each piece looks for a place with its own generator, the large kinds first; what cannot be placed, or bars the passage,
makes the whole arrangement start anew with other numbers, a bounded number of times.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

import numpy as np

from anysim.conventions import Array
from anysim_assets.rooms import outlines as G
from anysim_assets.rooms.furniture import MAKERS, Piece, piece
from anysim_assets.rooms.occupancy import Occupancy
from anysim_assets.rooms.plan import RoomPlan
from anysim_schemas.rooms import names_of

ARRANGEMENTS = 24
"""Arrangements that are begun before the furniture is said not to fit."""

CANDIDATES = 150
"""Places that are looked at for one piece."""

GAP = 0.03
"""[m] between pieces, and between a piece and the wall behind it."""

FRONT: Mapping[str, float] = {"wardrobe": 0.6, "counter": 0.7, "sofa": 0.5, "shelf": 0.45, "desk": 0.7, "bed": 0.3}
"""[m] that stay free in front of a piece; chairs may stand there."""

OPEN: Mapping[str, float] = {"table": 0.55}
"""[m] around what stands in the open."""

HOSTS: Mapping[str, tuple[str, ...]] = {"chair": ("desk", "table")}


class NoPlace(Exception):
    """A piece that found no place, or what is wrong with the whole."""


@dataclass(frozen=True)
class PlacedPiece:
    """A piece of furniture in the room, by its middle (2,) [m] and yaw [rad]."""

    name: str
    kind: str
    piece: Piece
    middle: Array
    yaw: float

    @property
    def footprint(self) -> Array:
        """Corners (4, 2) of what it covers."""
        return G.oriented_rectangle(self.middle, self.piece.half, self.yaw)

    def zone(self, depth: float) -> Array:
        """The rectangle (4, 2) in front of it."""
        ahead = G.turned(np.array([0.0, self.piece.half[1] + depth / 2]), self.yaw)
        return G.oriented_rectangle(self.middle + ahead, (self.piece.half[0], depth / 2), self.yaw)


def furnish(plan: RoomPlan, pieces: Mapping[str, int], walkway: float, seed: int) -> list[PlacedPiece]:
    """All pieces in their places.

    Raises:
        NoPlace: they do not fit; says which piece, and how large it is.
    """
    troubles: dict[str, int] = {}
    for attempt in range(ARRANGEMENTS):
        try:
            return _arrange(plan, pieces, walkway, seed, attempt)
        except NoPlace as error:
            troubles[str(error)] = troubles.get(str(error), 0) + 1
    worst = max(troubles, key=lambda text: (troubles[text], text))
    raise NoPlace(
        f"{worst}, in {troubles[worst]} of {ARRANGEMENTS} arrangements of {sum(pieces.values())} pieces on "
        f"{G.size(G.corners_of(plan.outline)):.1f} square metres; have fewer, or a larger room"
    )


def _arrange(plan: RoomPlan, pieces: Mapping[str, int], walkway: float, seed: int, attempt: int) -> list[PlacedPiece]:
    placed: list[PlacedPiece] = []
    doors = [plan.approach(o) for o in plan.openings if o.is_door]
    for name, kind in names_of(pieces):
        number = list(MAKERS).index(kind)
        index = sum(other.kind == kind for other in placed)
        made = piece(kind, _generator(seed, number, index))  # the same piece in every arrangement
        rng = _generator(seed, number, index, attempt + 1)
        for _ in range(CANDIDATES):
            spot = _candidate(plan, kind, made, placed, rng)
            one = PlacedPiece(name, kind, made, spot[0], spot[1])
            if _fits(plan, one, placed, doors):
                placed.append(one)
                break
        else:
            width, depth = (2 * half for half in made.half)
            raise NoPlace(f"no place for '{name}' ({width:.2f} by {depth:.2f} m)")
    if walkway > 0 and not passable(plan, placed, walkway):
        raise NoPlace(f"no way of {walkway:g} m is left from door to door")
    return placed


def _generator(*seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))


def passable(plan: RoomPlan, placed: list[PlacedPiece], walkway: float) -> bool:
    """Whether a disc of the passage's width gets from each door to the others, and to the largest part of the room."""
    solid = [one.footprint for one in placed]
    grid = Occupancy.of_footprints(solid, plan.outline, 0.05)
    inner = [plan.approach(o).mean(axis=0) for o in plan.openings if o.is_door]
    return grid.connected(np.array(inner).reshape(-1, 2), walkway / 2)


# ---------------------------------------------------------------------- candidates


def _candidate(
    plan: RoomPlan, kind: str, made: Piece, placed: list[PlacedPiece], rng: np.random.Generator
) -> tuple[Array, float]:
    """A place to look at: (middle (2,), yaw)."""
    hosts = [other for other in placed if other.kind in HOSTS.get(kind, ())]
    if hosts and rng.random() < 0.9:
        return _seat(made, hosts, placed, rng)
    beds = [other for other in placed if other.kind == "bed"]
    if kind == "nightstand" and beds and rng.random() < 0.9:
        return _beside(made, beds[int(rng.integers(len(beds)))], rng)
    if kind in OPEN:
        low, high = plan.outline.min(axis=0), plan.outline.max(axis=0)
        wall = plan.walls[int(rng.integers(len(plan.walls)))]
        return low + (high - low) * rng.uniform(0.15, 0.85, size=2), wall.yaw
    corner = 0.85 if kind in ("lamp", "plant") else 0.35
    return _at_wall(plan, made, rng, corner)


def _at_wall(plan: RoomPlan, made: Piece, rng: np.random.Generator, corner: float) -> tuple[Array, float]:
    lengths = np.array([wall.length for wall in plan.walls])
    wall = plan.walls[int(rng.choice(len(lengths), p=lengths / lengths.sum()))]
    room = max(0.0, wall.length / 2 - made.half[0] - GAP)
    along = float(rng.uniform(-room, room))
    if rng.random() < corner:  # flush with one of its ends
        along = float(rng.choice([-room, room]))
    return wall.at(wall.length / 2 + along, made.half[1] + GAP), wall.yaw


def _seat(
    made: Piece, hosts: list[PlacedPiece], placed: list[PlacedPiece], rng: np.random.Generator
) -> tuple[Array, float]:
    """At a side of a table, or before a desk, facing it; at the one that has fewest."""

    def taken(host: PlacedPiece) -> int:
        reach = float(np.hypot(*host.piece.half)) + 0.5
        return sum(o.kind == "chair" and bool(np.linalg.norm(o.middle - host.middle) < reach) for o in placed)

    # a desk takes one; then those with fewest seats come first
    free = [host for host in hosts if host.kind != "desk" or taken(host) == 0] or hosts
    fewest = min(taken(host) for host in free)
    free = [host for host in free if taken(host) == fewest] if rng.random() < 0.7 else free
    host = free[int(rng.integers(len(free)))]
    x, y = host.piece.half
    side = 0 if host.kind == "desk" else int(rng.integers(4))
    half, out = ((x, y), (y, x))[side % 2]
    spread = max(0.0, half - made.half[0] - 0.02)
    slot = (
        float(rng.choice([-0.5, 0.0, 0.5])) * 2 * spread
        if host.kind != "desk"
        else float(rng.uniform(-0.3, 0.3)) * spread
    )
    direction = side * pi / 2  # 0 is the host's front
    local = G.turned(np.array([slot, out + made.half[1] + GAP + float(rng.uniform(0.01, 0.12))]), direction)
    return host.middle + G.turned(local, host.yaw), host.yaw + direction + pi


def _beside(made: Piece, bed: PlacedPiece, rng: np.random.Generator) -> tuple[Array, float]:
    side = -1 if rng.random() < 0.5 else 1
    local = np.array([side * (bed.piece.half[0] + made.half[0] + GAP + 0.02), -bed.piece.half[1] + made.half[1]])
    return bed.middle + G.turned(local, bed.yaw), bed.yaw


# ---------------------------------------------------------------------- rules


def _fits(plan: RoomPlan, one: PlacedPiece, placed: list[PlacedPiece], doors: list[Array]) -> bool:
    own = one.footprint
    if not G.encloses(plan.outline, own):
        return False
    if any(G.overlap(own, door) for door in doors):
        return False
    for opening in plan.openings:
        tall = one.piece.height > opening.bottom and not opening.is_door
        if tall and G.overlap(own, plan.approach(opening, 0.35)):
            return False
    around = OPEN.get(one.kind, GAP * 0.9)
    if one.kind in OPEN and not G.encloses(
        plan.outline, G.oriented_rectangle(one.middle, _grown(one, around), one.yaw)
    ):
        return False
    for other in placed:
        seat = one.kind in HOSTS and other.kind in HOSTS[one.kind]
        gap = GAP * 0.9 if seat else max(around, OPEN.get(other.kind, 0.0) if one.kind not in HOSTS else 0.0)
        if G.overlap(own, other.footprint, gap):
            return False
        depth = FRONT.get(other.kind, 0.0)
        if depth and one.kind not in HOSTS and G.overlap(own, other.zone(depth)):
            return False
        depth = FRONT.get(one.kind, 0.0)
        if depth and G.overlap(one.zone(depth), other.footprint):
            return False
    depth = FRONT.get(one.kind, 0.0)
    return not depth or G.encloses(plan.outline, one.zone(depth))


def _grown(one: PlacedPiece, by: float) -> tuple[float, float]:
    return one.piece.half[0] + by, one.piece.half[1] + by
