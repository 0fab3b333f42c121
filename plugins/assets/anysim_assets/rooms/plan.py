"""The plan of a room: walls in pieces around their openings, and the floor, as parts of one static thing."""

from dataclasses import dataclass
from math import atan2, pi

import numpy as np

from anysim.conventions import Array
from anysim.errors import Issues
from anysim_assets.rooms import outlines as G
from anysim_schemas.rooms import DoorSpec, OpeningSpec, RoomSpec, WindowSpec

APPROACH = 0.9
"""[m] that stays free in front of a door."""

PANE = 0.012
"""[m] thickness of the glass of a window."""


@dataclass(frozen=True)
class Wall:
    """A side of the room: from `start` (2,) along `yaw` for `length` [m]; `inward` (2,) is its normal into the room."""

    start: Array
    length: float
    yaw: float
    inward: Array

    def at(self, along: float, into: float = 0.0) -> Array:
        """The point `along` the wall and `into` the room [m]."""
        return self.start + along * np.array([np.cos(self.yaw), np.sin(self.yaw)]) + into * self.inward


@dataclass(frozen=True)
class Opening:
    """A door or window: its wall by number, from `low` to `high` along it, and from `bottom` to `top` [m]."""

    wall: int
    low: float
    high: float
    bottom: float
    top: float
    is_door: bool


@dataclass(frozen=True)
class WallBox:
    """A box of a wall: half sizes, middle [m] and yaw [rad]; `kind` is wall, pane or ceiling."""

    name: str
    half: tuple[float, float, float]
    middle: tuple[float, float, float]
    yaw: float
    kind: str = "wall"


@dataclass(frozen=True)
class RoomPlan:
    """A room without furniture: the polygon of its floor (K, 2), counterclockwise, its walls and openings."""

    outline: Array
    walls: tuple[Wall, ...]
    openings: tuple[Opening, ...]
    height: float
    thickness: float

    def approach(self, opening: Opening, depth: float = APPROACH) -> Array:
        """The rectangle (4, 2) in front of an opening, inside the room."""
        wall, half = self.walls[opening.wall], (opening.high - opening.low) / 2
        middle = wall.at((opening.low + opening.high) / 2, depth / 2)
        return G.oriented_rectangle(middle, (half, depth / 2), wall.yaw)


def plan_of(spec: RoomSpec, issues: Issues) -> RoomPlan | None:
    """The plan of a room; None where it cannot be, with the reasons in `issues`, whose path is that of the room."""
    outline = np.array(spec.outline, dtype=float)
    crossed = G.crossing(outline)
    if crossed is not None:
        issues.add("plan", f"the walls {crossed[0]} and {crossed[1]} cross each other")
        return None
    if G.size(G.corners_of(outline)) <= 0:
        issues.add("plan", "the corners go clockwise; list them counterclockwise, seen from above")
        return None
    walls = tuple(_wall(a, b) for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True))
    if min(wall.length for wall in walls) < 0.1:
        issues.add("plan", "two corners are less than 0.1 m apart")
        return None
    openings: list[Opening] = []
    named: list[tuple[str, int, OpeningSpec]] = [("doors", i, door) for i, door in enumerate(spec.doors)]
    named += [("windows", i, window) for i, window in enumerate(spec.windows)]
    for key, i, opening in named:
        made = _opening(spec, walls, opening, openings, issues.at(key, i))
        if made is None:
            return None
        openings.append(made)
    return RoomPlan(outline, walls, tuple(openings), spec.height, spec.thickness)


def _wall(start: Array, end: Array) -> Wall:
    run = end - start
    length = float(np.linalg.norm(run))
    x, y = run / length
    return Wall(start, length, atan2(y, x), np.array([-y, x]))


def _opening(
    spec: RoomSpec, walls: tuple[Wall, ...], opening: OpeningSpec, others: list[Opening], issues: Issues
) -> Opening | None:
    number = spec.wall_number(opening)
    assert isinstance(opening, DoorSpec | WindowSpec)
    length, bottom = walls[number].length, 0.0 if isinstance(opening, DoorSpec) else opening.sill
    low = opening.at * length - opening.width / 2
    made = Opening(number, low, low + opening.width, bottom, bottom + opening.height, isinstance(opening, DoorSpec))
    if made.low < 0.05 or made.high > length - 0.05:
        issues.add(
            "at",
            f"a width of {opening.width:g} m does not fit at {opening.at:g} of a wall of {length:g} m (from "
            f"{made.low:.2f} to {made.high:.2f} m, 0.05 m from the corners)",
        )
        return None
    if made.top > spec.height - 0.05:
        issues.add("height", f"reaches {made.top:g} m, the walls {spec.height:g} m; make it at least 0.05 m lower")
        return None
    for other in others:
        if other.wall == number and made.low < other.high + 0.05 and other.low < made.high + 0.05:
            issues.add("at", "overlaps another opening of this wall; move one of them")
            return None
    return made


def wall_boxes(plan: RoomPlan, ceiling: bool) -> list[WallBox]:
    """The boxes of the walls around their openings, the panes, and the ceiling."""
    boxes: list[WallBox] = []
    for number, wall in enumerate(plan.walls):
        ends = [-_reach(plan, number, 0), wall.length + _reach(plan, number, 1)]
        own = sorted((o for o in plan.openings if o.wall == number), key=lambda o: o.low)
        edges = [ends[0], *(e for o in own for e in (o.low, o.high)), ends[1]]
        for k in range(0, len(edges), 2):
            boxes.append(_box(plan, number, f"wall{number}_{k // 2}", edges[k], edges[k + 1], 0.0, plan.height))
        for k, o in enumerate(own):
            boxes.append(_box(plan, number, f"lintel{number}_{k}", o.low, o.high, o.top, plan.height))
            if not o.is_door:
                boxes.append(_box(plan, number, f"sill{number}_{k}", o.low, o.high, 0.0, o.bottom))
                boxes.append(_box(plan, number, f"pane{number}_{k}", o.low, o.high, o.bottom, o.top, "pane"))
    if ceiling:
        low, high = plan.outline.min(axis=0) - plan.thickness, plan.outline.max(axis=0) + plan.thickness
        half, middle = (high - low) / 2, (high + low) / 2
        boxes.append(
            WallBox(
                "ceiling",
                (float(half[0]), float(half[1]), 0.05),
                (float(middle[0]), float(middle[1]), plan.height + 0.05),
                0.0,
                "ceiling",
            )
        )
    return boxes


def _reach(plan: RoomPlan, number: int, end: int) -> float:
    """How far a wall goes on beyond its corner, so that the outer corner is closed."""
    n = len(plan.walls)
    first, second = (number - 1, number) if end == 0 else (number, (number + 1) % n)
    turn = (plan.walls[second].yaw - plan.walls[first].yaw + pi) % (2 * pi) - pi
    return plan.thickness * float(np.tan(min(turn, 0.9 * pi) / 2)) if turn > 0 else 0.0


def _box(
    plan: RoomPlan, number: int, name: str, start: float, end: float, low: float, high: float, kind: str = "wall"
) -> WallBox:
    wall, thick = plan.walls[number], PANE if kind == "pane" else plan.thickness
    x, y = wall.at((start + end) / 2, -plan.thickness / 2)
    half = ((end - start) / 2, thick / 2, (high - low) / 2)
    return WallBox(name, half, (float(x), float(y), (low + high) / 2), wall.yaw, kind)
