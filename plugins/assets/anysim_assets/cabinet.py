"""A cabinet: a carcass of boards, with drawers and doors in columns."""

from itertools import pairwise
from math import hypot, pi
from typing import Any, Literal, NamedTuple

from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim.model.world import JointType
from anysim_assets.assembly import Assembly
from anysim_assets.handles import add_handle
from anysim_assets.parameters import Angle, Handle, Size
from anysim_schemas.base import Color, Fraction, NonNegative, Positive, Spec
from anysim_schemas.errors import KeyFault


class Front(Spec):
    """One compartment of a column and what closes it. A bare string says which: `drawer`."""

    front: Literal["drawer", "door", "double_door", "open", "panel"] = Field(description="what closes it, if anything")
    height: Positive = Field(default=1.0, description="share of the column's height")
    hinge: Literal["auto", "left", "right"] = Field(
        default="auto",
        description="side of a door's hinge, seen from the front; auto: the outer side, or away from drawers beside it",
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """What closes it."""
        return {"front": text}


class _Cell(NamedTuple):
    """A compartment: what closes it, what its front covers, and the space inside, along y and z [m]."""

    front: Front
    outer: tuple[float, float, float, float]  # y, y, z, z
    inner: tuple[float, float, float, float]


_DRAWER = Front(front="drawer")
_COLUMNS = ((_DRAWER, _DRAWER, _DRAWER), (Front(front="door"),))
_HANDLE = Handle()


def cabinet(
    *,
    size: Size = (0.45, 0.6, 0.7),
    columns: tuple[tuple[Front, ...], ...] = _COLUMNS,
    widths: tuple[Positive, ...] | None = None,
    wall: Positive = 0.016,
    front_thickness: Positive = 0.018,
    drawer_wall: Positive = 0.01,
    gap: Positive = 0.003,
    base: NonNegative = 0.04,
    drawer_travel: Fraction = 0.8,
    door_angle: Angle = pi / 2,
    drawer_friction: NonNegative = 2.0,
    drawer_damping: NonNegative = 2.0,
    door_friction: NonNegative = 0.2,
    door_damping: NonNegative = 0.1,
    handle: Handle = _HANDLE,
    density: Positive = 600.0,
    color: Color = (0.80, 0.73, 0.62),
    front_color: Color = (0.93, 0.90, 0.84),
    handle_color: Color = (0.35, 0.36, 0.38),
) -> ImportedModel:
    """A cabinet with drawers and doors; its frame is in the middle of the bottom, the front looks along +x.

    Links and joints are `drawer_1`, `drawer_2`, … and `door_1`, … column by column from left to right as seen from the
    front, each from top to bottom; both leaves of a double door count. Positive is open. Frames: `drawer_1.handle`,
    `drawer_1.inside` (the middle of its floor), and `shelf_1`, … (the middle of the floor of each other compartment).
    A drawer or door never collides with the carcass that it is joined to: only its limits hold it, so it cannot jam.
    Two of them do collide, and keep a gap; as in a kitchen, the handle of an open door reaches over what is beside it.

    Args:
        size: depth, width and height [m], handles not included.
        columns: from left to right, each a list of compartments from top to bottom.
        widths: shares of the columns; equal where not given.
        wall: thickness of the carcass's boards [m].
        front_thickness: thickness of drawers' fronts and doors [m].
        drawer_wall: thickness of a drawer's sides, back and floor [m].
        gap: between fronts, and around drawers [m].
        base: height of the plinth below the lowest compartments [m].
        drawer_travel: how far a drawer comes out, as a share of its depth.
        door_angle: how far a door opens [rad].
        drawer_friction: dry friction of a drawer [N].
        drawer_damping: [N s/m].
        door_friction: dry friction of a door's hinge [N m].
        door_damping: [N m s/rad].
        handle: the handle of each drawer and door.
        density: of the boards [kg/m^3].
        color: of the carcass and of the drawers' insides.
        front_color: of the fronts.
        handle_color: of the handles.

    Raises:
        KeyFault: the parts do not fit into the size.
    """
    depth, width, height = size
    cells = _cells(columns, widths, width, height, base, wall, gap)
    body = Assembly("cabinet")
    back, face = -depth / 2, depth / 2
    rim = face - front_thickness - gap  # where the carcass ends
    inside = back + wall
    if rim - inside < 4 * drawer_wall:
        raise KeyFault(f"a depth of {depth:g} m leaves no room between its back and its fronts", "size")
    _carcass(body, cells, (back, rim), (width, height, base, wall), density, color)
    counts = {"drawer": 0, "door": 0, "shelf": 0}

    def number(kind: str) -> str:
        counts[kind] += 1
        return f"{kind}_{counts[kind]}"

    def leaf(outer: tuple[float, float, float, float], hinge: str) -> None:
        low, high, bottom, top = outer
        breadth, name = high - low, number("door")
        overshoot = hypot(breadth, front_thickness) - breadth  # of the free edge's inner corner, as it swings out
        if overshoot >= gap:
            raise KeyFault(
                f"{name} is {breadth:g} m wide and {front_thickness:g} m thick: it cannot swing past what is beside "
                f"it; give a gap above {overshoot:.2g} m, or a thinner front",
                "gap",
            )
        # the axis is the outer edge of the front face: an open door stays within its own width
        edge, sign = (low, 1.0) if hinge == "left" else (high, -1.0)
        origin = (face, edge, (bottom + top) / 2)
        link = body.link(
            name,
            origin,
            JointType.REVOLUTE,
            (0.0, 0.0, -sign),
            lower=0.0,
            upper=door_angle,
            friction=door_friction,
            damping=door_damping,
        )
        body.board(
            link, "front", (face - front_thickness, low, bottom), (face, high, top), density, front_color, origin
        )
        reach = min(0.05, breadth / 4)  # from the free edge to the middle of the handle
        at = (0.0, sign * (breadth - reach), 0.0)
        add_handle(body, link, handle, at, (2 * reach, top - bottom), handle_color, upright=True, link=name)

    def drawer(cell: _Cell) -> None:
        low, high, bottom, top = cell.outer
        name = number("drawer")
        y0, y1 = cell.inner[0] + gap, cell.inner[1] - gap
        z0 = cell.inner[2] + gap
        z1 = z0 + 0.75 * (cell.inner[3] - gap - z0)  # lower than its opening: things go in and out from above
        x0, x1, w = inside + gap, face - front_thickness, drawer_wall
        if y1 - y0 <= 4 * w or z1 - z0 <= 2 * w:
            raise KeyFault(f"{name} has no room for a box with walls of {w:g} m", "columns")
        origin = (face, (low + high) / 2, (bottom + top) / 2)
        link = body.link(
            name,
            origin,
            JointType.PRISMATIC,
            (1.0, 0.0, 0.0),
            lower=0.0,
            upper=drawer_travel * (x1 - x0),
            friction=drawer_friction,
            damping=drawer_damping,
        )
        body.board(link, "front", (x1, low, bottom), (face, high, top), density, front_color, origin)
        for part, one, other in (
            ("floor", (x0, y0, z0), (x1, y1, z0 + w)),
            ("left", (x0, y0, z0 + w), (x1, y0 + w, z1)),
            ("right", (x0, y1 - w, z0 + w), (x1, y1, z1)),
            ("back", (x0, y0 + w, z0 + w), (x0 + w, y1 - w, z1)),
        ):
            body.board(link, part, one, other, density, color, origin)
        room = (high - low, top - bottom)
        add_handle(body, link, handle, (0.0, 0.0, 0.0), room, handle_color, upright=False, link=name)
        floor = ((x0 + w + x1) / 2 - origin[0], (y0 + y1) / 2 - origin[1], z0 + w - origin[2])
        body.site(link, f"{name}.inside", floor)

    for cell in cells:
        kind = cell.front.front
        low, high, bottom, top = cell.outer
        if kind == "drawer":
            drawer(cell)
            continue
        y0, y1, z0, _ = cell.inner
        body.site(0, number("shelf"), ((inside + rim) / 2, (y0 + y1) / 2, z0))
        if kind == "door":
            leaf(cell.outer, cell.front.hinge)
        elif kind == "double_door":
            middle = (low + high) / 2
            leaf((low, middle - gap / 2, bottom, top), "left")
            leaf((middle + gap / 2, high, bottom, top), "right")
        elif kind == "panel":
            body.board(0, f"panel_{counts['shelf']}", (rim, low, bottom), (face, high, top), density, front_color)
    return body.model()


def _cells(
    columns: tuple[tuple[Front, ...], ...],
    widths: tuple[float, ...] | None,
    width: float,
    height: float,
    base: float,
    wall: float,
    gap: float,
) -> list[_Cell]:
    """All compartments, left to right, each column from top to bottom."""
    if not columns or not all(columns):
        raise KeyFault("a cabinet needs at least one column, and each column at least one compartment", "columns")
    shares = widths or (1.0,) * len(columns)
    if len(shares) != len(columns):
        raise KeyFault(f"{len(columns)} columns need {len(columns)} widths, got {len(shares)}", "widths")
    if height <= base + 2 * wall:
        raise KeyFault(f"a height of {height:g} m has no room above a base of {base:g} m", "size")
    cells: list[_Cell] = []
    ends = _divided(-width / 2, width / 2, shares)
    for column, (low, high) in enumerate(pairwise(ends)):
        rows = columns[column]
        levels = _divided(height, base, [front.height for front in rows])
        left = low + (wall if column == 0 else wall / 2)
        right = high - (wall if column == len(columns) - 1 else wall / 2)
        for row, (top, bottom) in enumerate(pairwise(levels)):
            above = wall if row == 0 else _shelf(rows[row - 1], rows[row], wall) / 2
            below = wall if row == len(rows) - 1 else _shelf(rows[row], rows[row + 1], wall) / 2
            outer = (low + gap / 2, high - gap / 2, bottom + gap / 2, top - gap / 2)
            inner = (left, right, bottom + below, top - above)
            if min(inner[1] - inner[0], inner[3] - inner[2]) <= 2 * gap:
                raise KeyFault(
                    f"compartment {row + 1} of column {column + 1} has no room inside: {inner[1] - inner[0]:.3g} m "
                    f"wide, {inner[3] - inner[2]:.3g} m high",
                    "columns",
                )
            front = rows[row]
            if front.hinge == "auto":
                front = front.model_copy(update={"hinge": _outer_side(columns, column)})
            cells.append(_Cell(front, outer, inner))
    return cells


def _outer_side(columns: tuple[tuple[Front, ...], ...], column: int) -> str:
    """Where a door of a column is hinged best: its open handle then reaches over no drawer, where that can be."""
    if column == 0:
        return "left"
    if column == len(columns) - 1 or any(front.front == "drawer" for front in columns[column - 1]):
        return "right"
    return "left"


def _divided(start: float, stop: float, shares: Any) -> list[float]:
    """From start to stop in steps that are to each other as the shares."""
    total, ends = sum(shares), [start]
    for i in range(1, len(shares)):
        ends.append(start + (stop - start) * sum(shares[:i]) / total)
    return [*ends, stop]


def _shelf(above: Front, below: Front, wall: float) -> float:
    """The thickness of the board between two compartments: drawers run without one between them."""
    return 0.0 if above.front == below.front == "drawer" else wall


def _carcass(
    body: Assembly,
    cells: list[_Cell],
    along: tuple[float, float],
    sizes: tuple[float, float, float, float],
    density: float,
    color: Any,
) -> None:
    """Boards that meet without overlapping: sides, floor and top between them, then back, dividers, shelves."""
    back, rim = along
    width, height, base, wall = sizes
    side, inner = width / 2, width / 2 - wall

    def board(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> None:
        body.board(0, name, low, high, density, color)

    if base > 0:
        board("plinth", (back, -side, 0.0), (rim, side, base))
    board("left", (back, -side, base), (rim, -inner, height))
    board("right", (back, inner, base), (rim, side, height))
    board("bottom", (back, -inner, base), (rim, inner, base + wall))
    board("top", (back, -inner, height - wall), (rim, inner, height))
    board("back", (back, -inner, base + wall), (back + wall, inner, height - wall))
    columns: dict[tuple[float, float], list[_Cell]] = {}
    for cell in cells:
        columns.setdefault(cell.inner[:2], []).append(cell)
    for number, ((_, end), (start, _)) in enumerate(pairwise(columns), 1):
        board(f"divider_{number}", (back + wall, end, base + wall), (rim, start, height - wall))
    for number, (span, stack) in enumerate(columns.items(), 1):
        for row, (above, below) in enumerate(pairwise(stack), 1):
            low, high = below.inner[3], above.inner[2]
            if high > low:
                board(f"shelf_{number}_{row}", (back + wall, span[0], low), (rim, span[1], high))
