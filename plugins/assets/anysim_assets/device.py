"""A laboratory device: a chamber behind a sliding door, with a well for a vial, and a button that starts it."""

from math import pi

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Cylinder, JointType
from anysim_assets.assembly import Assembly, turned
from anysim_assets.handles import add_handle
from anysim_assets.parameters import Handle, Size
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault

_LEAF, _GAP = 0.012, 0.003  # [m] thickness of the door, and the gaps around it
_GLASS = 0.4  # alpha of the door
_LAP = 0.01  # [m] by which the door is wider than what it covers
_KNOB, _PLATE = 0.005, 0.004  # [m] half the button's height, thickness of the plates on the console
_EDGE = 0.05  # [m] from the handle to the door's edge: fingers astride it do not reach around that
_BAR = Handle(length=0.1)
_FORWARD = turned((0.0, 1.0, 0.0), pi / 2)  # z along the device's +x


def device(
    *,
    size: Size = (0.22, 0.6, 0.36),
    opening: Positive = 0.28,
    wall: Positive = 0.012,
    base: Positive = 0.04,
    console: Positive = 0.09,
    well: Positive = 0.034,
    well_depth: Positive = 0.05,
    well_inset: Positive = 0.052,
    door_friction: NonNegative = 2.0,
    door_damping: NonNegative = 5.0,
    radius: Positive = 0.02,
    travel: Positive = 0.01,
    button_friction: NonNegative = 0.5,
    button_damping: NonNegative = 2.0,
    handle: Handle = _BAR,
    density: Positive = 900.0,
    color: Color = (0.88, 0.89, 0.9),
    door_color: Color = (0.45, 0.6, 0.7),
    handle_color: Color = (0.2, 0.2, 0.22),
    button_color: Color = (0.1, 0.6, 0.25),
) -> ImportedModel:
    """A device with a sliding door at its front (+x); its frame is in the middle of its bottom.

    Its chamber is at the side of +y, and what drives it is at the other, in front of which the door slides. Over both
    is a console. The link and joint `door` is closed at zero and positive is open. The link and joint `start` is a
    button on the console, at zero where it is out and positive pressed; neither has a spring or a latch of its own.
    Frames: `door.handle` as on a cabinet, `start.top` with z out of the button, `chamber`, the middle of the chamber's
    floor, and `well`, the middle of the floor of the square well that stands on it.

    Args:
        size: depth with the door, width and height [m], neither the handle nor the button included.
        opening: width of the chamber [m].
        wall: thickness of the boards, and of the walls of the well [m].
        base: height of what is below the chamber [m].
        console: height of what is above it [m].
        well: inner edge length of the well [m].
        well_depth: of the well [m].
        well_inset: from the front to the middle of the well [m].
        door_friction: dry friction of the door [N].
        door_damping: [N s/m].
        radius: of the button [m].
        travel: of the button [m].
        button_friction: dry friction of the button [N].
        button_damping: [N s/m].
        handle: of the door, upright near the edge that is to the fore when it closes.
        density: [kg/m^3].
        color: of the boards and the well.
        door_color: of the door, which is of glass.
        handle_color: of the handle, the display and the button's housing.
        button_color: of the button.

    Raises:
        KeyFault: the parts do not fit into the size.
    """
    depth, width, height = size
    x, y, face, ceiling = depth / 2, width / 2, depth / 2 - _LEAF - _GAP, height - console
    across, place, way = well / 2 + wall, depth / 2 - well_inset, opening + wall
    if 2 * way + _LAP > width:
        raise KeyFault(f"a door of {way + _LAP:g} m cannot slide aside on a front of {width:g} m", "size")
    if place + across > face or place - across < -x + wall or 2 * across > opening or base + well_depth > ceiling:
        raise KeyFault(f"a well of {well:g} m does not fit into the chamber", "well")
    if 2 * radius >= console:
        raise KeyFault(f"a button of radius {radius:g} m is larger than the console of {console:g} m", "radius")
    body, inner, rim = Assembly("device"), y - way, base + well_depth
    middle = inner + opening / 2
    for name, low, high in (
        ("base", (-x, -y, 0.0), (x, y, base)),
        ("console", (-x, -y, ceiling), (x, y, height)),
        ("works", (-x, -y, base), (face, inner, ceiling)),
        ("back", (-x, inner, base), (-x + wall, y, ceiling)),
        ("side", (-x + wall, y - wall, base), (face, y, ceiling)),
        ("well_back", (place - across, middle - across, base), (place - well / 2, middle + across, rim)),
        ("well_front", (place + well / 2, middle - across, base), (place + across, middle + across, rim)),
        ("well_right", (place - well / 2, middle - across, base), (place + well / 2, middle - well / 2, rim)),
        ("well_left", (place - well / 2, middle + well / 2, base), (place + well / 2, middle + across, rim)),
    ):
        body.board(0, name, low, high, density, color)
    body.site(0, "chamber", ((face - x + wall) / 2, middle, base))
    body.site(0, "well", (place, middle, base))
    level, plate = height - console / 2, console / 2 - 0.01
    for name, beside, half in (("display", (inner - y) / 2, 2 * plate), ("panel", middle, plate)):
        low, high = (x, beside - half, level - plate), (x + _PLATE, beside + half, level + plate)
        body.board(0, name, low, high, density, handle_color)
    origin = (x, y - way / 2, (base + ceiling) / 2)
    slide, aside = JointType.PRISMATIC, (0.0, -1.0, 0.0)
    door = body.link("door", origin, slide, aside, lower=0.0, upper=way, friction=door_friction, damping=door_damping)
    low, high = (x - _LEAF, inner - _LAP, base + _GAP), (x, y, ceiling - _GAP)
    body.board(door, "leaf", low, high, density, door_color, origin, alpha=_GLASS)
    at, room = (0.0, way / 2 - handle.radius - _EDGE, 0.0), (2 * (_EDGE + handle.radius), ceiling - base)
    add_handle(body, door, handle, at, room, handle_color, upright=True, link="door")

    out = (x + _PLATE + _GAP + travel, middle, level)
    inward, resists = (-1.0, 0.0, 0.0), {"friction": button_friction, "damping": button_damping}
    start = body.link("start", out, slide, inward, lower=0.0, upper=travel, parent=0, **resists)
    body.solid(start, "knob", Cylinder(radius, _KNOB), (_KNOB, 0.0, 0.0), density, button_color, _FORWARD)
    body.site(start, "start.top", (2 * _KNOB, 0.0, 0.0), _FORWARD)
    button = AffordanceKind.BUTTON
    body.afford(Affordance("start", button, "start.top", ("start.knob",), ("press",), joint="start", depth=travel))
    return body.model()
