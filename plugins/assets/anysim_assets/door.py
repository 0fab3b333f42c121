"""A room door in its frame."""

from math import radians
from typing import Literal

from anysim.assets.model import ImportedModel
from anysim.model.world import JointType
from anysim_assets.assembly import Assembly
from anysim_assets.handles import add_handle, add_lever
from anysim_assets.parameters import Angle, Handle, Size
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault

_ANGLE = radians(110)
_BAR = Handle(radius=0.01, length=0.12, standoff=0.06, direction="horizontal")
_BACKSET = 0.06  # [m] of a lever's axis from the leaf's edge


def door(
    *,
    size: Size = (0.04, 0.8, 2.0),
    frame: Positive = 0.08,
    gap: Positive = 0.01,
    swing: Literal["out", "in"] = "out",
    angle: Angle = _ANGLE,
    friction: NonNegative = 2.0,
    damping: NonNegative = 0.5,
    handle: Handle = _BAR,
    handle_height: Positive = 1.0,
    lever: Angle | None = None,
    density: Positive = 300.0,
    color: Color = (0.80, 0.78, 0.74),
    leaf_color: Color = (0.55, 0.38, 0.24),
    handle_color: Color = (0.35, 0.36, 0.38),
) -> ImportedModel:
    """A door leaf between two posts and a lintel; its frame is on the ground in the middle of the opening.

    The frame's x goes through the opening. The link and joint `leaf` is closed at zero and positive is open; its hinge
    is upright at the left edge, seen along x. `out` swings to the side of +x, where the handle is, `in` to the other.
    The leaf stays where its friction holds it. The frame `leaf.handle` is as on a cabinet, x away from the leaf.

    With `lever` the handle is a link and joint of that name on the leaf: a bar that is level at zero and points to the
    hinge, and positive is pressed down. The frame `lever.handle` is on it, two thirds of its length from its axis, and
    `leaf.handle` is where that is at zero. A joint has neither spring nor latch: the events `tasks.spring` and
    `tasks.latch` make them.

    Args:
        size: thickness, width and height of the leaf [m].
        frame: width and depth of the posts and the lintel [m].
        gap: around the leaf [m]; at the hinge it is as wide as the leaf's corner needs.
        swing: to which side it opens.
        angle: how far it opens [rad].
        friction: dry friction of the hinge [N m].
        damping: [N m s/rad].
        handle: on the side of +x, near the edge away from the hinge; a fixed bar.
        handle_height: of its middle, or of the lever's axis, above the ground [m].
        lever: how far the bar of the handle turns about the leaf's normal [rad]; without it the bar is fixed.
        density: of the leaf [kg/m^3].
        color: of the posts and the lintel.
        leaf_color: of the leaf.
        handle_color: of the handle.

    Raises:
        KeyFault: the handle does not fit onto the leaf.
    """
    thick, width, height = size
    x, y, room = thick / 2, width / 2, gap + thick / 2
    top = gap + height
    if not gap < handle_height < top:
        raise KeyFault(f"a handle at {handle_height:g} m is not on a leaf of {height:g} m", "handle_height")
    body, deep = Assembly("door"), frame / 2
    for name, low, high in (
        ("left", (-deep, y + room, 0.0), (deep, y + room + frame, top + gap)),
        ("right", (-deep, -y - gap - frame, 0.0), (deep, -y - gap, top + gap)),
        ("lintel", (-deep, -y - gap - frame, top + gap), (deep, y + room + frame, top + gap + frame)),
    ):
        body.board(0, name, low, high, density, color)
    origin = (0.0, y, 0.0)
    leaf = body.link(
        "leaf",
        origin,
        JointType.REVOLUTE,
        (0.0, 0.0, 1.0 if swing == "out" else -1.0),
        lower=0.0,
        upper=angle,
        friction=friction,
        damping=damping,
    )
    body.board(leaf, "board", (-x, -y, gap), (x, y, top), density, leaf_color, origin)
    if lever is not None:
        at = (x, _BACKSET - width, handle_height)
        add_lever(body, leaf, handle, at, width - _BACKSET, lever, handle_color, link="leaf")
        return body.model()
    margin = handle.length / 2 + 2 * handle.radius + 0.03
    at = (x, -width + margin, handle_height)
    space = (2 * margin, 2 * min(handle_height - gap, top - handle_height))
    add_handle(body, leaf, handle, at, space, handle_color, upright=False, link="leaf")
    return body.model()
