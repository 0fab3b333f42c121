"""A box with a hinged lid."""

from math import radians

from anysim.assets.model import ImportedModel
from anysim.model.world import JointType
from anysim_assets.assembly import Assembly
from anysim_assets.handles import add_handle
from anysim_assets.parameters import Angle, Handle, Size
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault

_LID_ANGLE = radians(110)
_KNOB = Handle(style="knob", standoff=0.025)


def hinge_box(
    *,
    size: Size = (0.3, 0.4, 0.2),
    wall: Positive = 0.01,
    lid: Positive = 0.012,
    gap: Positive = 0.002,
    lid_angle: Angle = _LID_ANGLE,
    lid_friction: NonNegative = 0.1,
    lid_damping: NonNegative = 0.05,
    handle: Handle = _KNOB,
    density: Positive = 600.0,
    color: Color = (0.62, 0.45, 0.30),
    lid_color: Color = (0.70, 0.53, 0.36),
    handle_color: Color = (0.35, 0.36, 0.38),
) -> ImportedModel:
    """A box with a hinged lid; its frame is in the middle of the bottom, the hinge at the back (-x).

    The link and joint `lid` is closed at zero and positive is open. Frames: `lid.handle` at the front of the lid, and
    `inside`, the middle of the box's floor.

    Args:
        size: depth, width and height with the closed lid [m], the handle not included.
        wall: thickness of the box's boards [m].
        lid: thickness of the lid [m].
        gap: between the box and the closed lid [m].
        lid_angle: how far the lid opens [rad].
        lid_friction: dry friction of the hinge [N m].
        lid_damping: [N m s/rad].
        handle: on the lid's front edge, pointing forward.
        density: of the boards [kg/m^3].
        color: of the box.
        lid_color: of the lid.
        handle_color: of the handle.

    Raises:
        KeyFault: the parts do not fit into the size.
    """
    depth, width, height = size
    x, y, top = depth / 2, width / 2, height - lid - gap
    if top <= 2 * wall or min(x, y) <= wall:
        raise KeyFault(f"walls of {wall:g} m and a lid of {lid:g} m leave nothing of the size", "size")
    body = Assembly("hinge_box")
    for name, low, high in (
        ("floor", (-x, -y, 0.0), (x, y, wall)),
        ("back", (-x, -y, wall), (-x + wall, y, top)),
        ("front", (x - wall, -y, wall), (x, y, top)),
        ("left", (-x + wall, -y, wall), (x - wall, -y + wall, top)),
        ("right", (-x + wall, y - wall, wall), (x - wall, y, top)),
    ):
        body.board(0, name, low, high, density, color)
    body.site(0, "inside", (0.0, 0.0, wall))
    # the axis is the upper edge at the back: an opening lid rises from the box everywhere
    origin = (-x, 0.0, height)
    link = body.link(
        "lid",
        origin,
        JointType.REVOLUTE,
        (0.0, -1.0, 0.0),
        lower=0.0,
        upper=lid_angle,
        friction=lid_friction,
        damping=lid_damping,
    )
    body.board(link, "board", (-x, -y, height - lid), (x, y, height), density, lid_color, origin)
    # a handle is mounted on the lid's edge and may be thicker than that: there is nothing but air around it
    add_handle(body, link, handle, (depth, 0.0, -lid / 2), (width, height), handle_color, upright=False, link="lid")
    return body.model()
