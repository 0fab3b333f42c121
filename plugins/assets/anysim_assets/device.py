"""A laboratory device: a chamber behind a door, with a well for a vial, and a button that starts it."""

from math import hypot, radians

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Cylinder, JointType
from anysim_assets.assembly import Assembly
from anysim_assets.handles import add_handle
from anysim_assets.parameters import Angle, Handle, Size
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault

_DOOR_ANGLE = radians(120)
_DOOR, _GAP = 0.014, 0.003  # thickness of the door, and the gap around it [m]
_BUTTON, _TRAVEL = 0.018, 0.01  # radius and travel of the button [m]


def device(
    *,
    size: Size = (0.22, 0.34, 0.34),
    wall: Positive = 0.012,
    base: Positive = 0.04,
    well: Positive = 0.04,
    well_depth: Positive = 0.04,
    well_inset: Positive = 0.075,
    door_angle: Angle = _DOOR_ANGLE,
    door_friction: NonNegative = 0.2,
    door_damping: NonNegative = 0.1,
    button_friction: NonNegative = 0.5,
    button_damping: NonNegative = 2.0,
    handle: Handle = Handle(length=0.1),
    density: Positive = 900.0,
    color: Color = (0.88, 0.89, 0.9),
    door_color: Color = (0.35, 0.42, 0.48),
    handle_color: Color = (0.2, 0.2, 0.22),
    button_color: Color = (0.1, 0.6, 0.25),
) -> ImportedModel:
    """A device with a door at its front (+x); its frame is in the middle of its bottom.

    The link and joint `door` is closed at zero and positive is open; it is hinged at its -y edge. The link and joint
    `start` is a button on the top, at zero where it is out; neither has a spring or a latch of its own. Frames:
    `door.handle` as on a cabinet, `start.top` with z out of the button, `chamber`, the middle of the chamber's floor,
    and `well`, the middle of the floor of the square well that stands there.

    Args:
        size: depth with the door, width and height [m], neither the handle nor the button included.
        wall: thickness of the boards, and of the walls of the well [m].
        base: height of what is below the chamber [m].
        well: inner edge length of the well [m].
        well_depth: of the well [m].
        well_inset: from the front to the middle of the well [m].
        door_angle: how far the door opens [rad].
        door_friction: dry friction of its hinge [N m].
        door_damping: [N m s/rad].
        button_friction: dry friction of the button [N].
        button_damping: [N s/m].
        handle: of the door, near its free edge.
        density: [kg/m^3].
        color: of the boards and the well.
        door_color: of the door.
        handle_color: of the handle.
        button_color: of the button.

    Raises:
        KeyFault: the parts do not fit into the size.
    """
    depth, width, height = size
    x, y, face = depth / 2, width / 2, depth / 2 - _DOOR - _GAP
    across = well / 2 + wall
    place = x - well_inset
    if place + across > face or place - across < -x + wall or across > y - wall or base + well_depth > height - wall:
        raise KeyFault(f"a well of {well:g} m does not fit into the chamber", "well")
    body = Assembly("device")
    for name, low, high in (
        ("base", (-x, -y, 0.0), (face, y, base)),
        ("back", (-x, -y, base), (-x + wall, y, height)),
        ("right", (-x + wall, -y, base), (face, -y + wall, height)),
        ("left", (-x + wall, y - wall, base), (face, y, height)),
        ("top", (-x + wall, -y + wall, height - wall), (face, y - wall, height)),
    ):
        body.board(0, name, low, high, density, color)
    rim = base + well_depth
    for name, low, high in (
        ("well_back", (place - across, -across, base), (place - well / 2, across, rim)),
        ("well_front", (place + well / 2, -across, base), (place + across, across, rim)),
        ("well_right", (place - well / 2, -across, base), (place + well / 2, -well / 2, rim)),
        ("well_left", (place - well / 2, well / 2, base), (place + well / 2, across, rim)),
    ):
        body.board(0, name, low, high, density, color)
    body.site(0, "chamber", ((face - x) / 2, 0.0, base))
    body.site(0, "well", (place, 0.0, base))
    if hypot(width, _DOOR) - width >= _GAP:
        raise KeyFault(f"a door of {width:g} m is too narrow to swing open", "size")
    origin = (x, -y, (base + height) / 2)
    turns = {"lower": 0.0, "upper": door_angle, "friction": door_friction, "damping": door_damping}
    door = body.link("door", origin, JointType.REVOLUTE, (0.0, 0.0, -1.0), **turns)
    body.board(door, "leaf", (x - _DOOR, -y, base + _GAP), (x, y, height), density, door_color, origin)
    at, room = (0.0, width - 0.05, 0.0), (0.1, height - base)
    add_handle(body, door, handle, at, room, handle_color, upright=True, link="door")
    # the housing of the button and the button, near the front on the left
    spot, low = (face - 0.05, y - 0.06), height + 0.012
    body.solid(0, "panel", Box((0.03, 0.03, 0.006)), (*spot, height + 0.006), density, handle_color)
    slides = {"lower": 0.0, "upper": _TRAVEL, "friction": button_friction, "damping": button_damping}
    start = body.link("start", (*spot, low + _TRAVEL + 0.002), JointType.PRISMATIC, (0.0, 0.0, -1.0), **slides)
    body.solid(start, "knob", Cylinder(_BUTTON, 0.005), (0.0, 0.0, 0.005), density, button_color)
    body.site(start, "start.top", (0.0, 0.0, 0.01))
    pressed = Affordance(
        "start", AffordanceKind.BUTTON, "start.top", ("start.knob",), ("press",), joint="start", depth=_TRAVEL
    )
    body.afford(pressed)
    return body.model()
