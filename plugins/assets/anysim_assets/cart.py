"""A cart that rolls to any side: a deck on casters with a bar to push it by."""

from math import pi

from anysim.assets.model import ImportedModel
from anysim.model.world import ORIGIN, Box, Cylinder, JointType, Sphere, Vec3
from anysim_assets.assembly import Assembly
from anysim_assets.handles import add_handle
from anysim_assets.parameters import Handle, Size
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault

_BAR = Handle(direction="horizontal", length=0.3, radius=0.0125, standoff=0.06)
_POST = 0.03
"""[m] edge of the two posts that carry the bar."""
_FREE = 0.005
"""[m] between the casters and the ground: joints carry the cart, so that no engine's rolling resistance holds it."""


def cart(
    *,
    size: Size = (0.5, 0.44, 0.03),
    deck: Positive = 0.3,
    bar_height: Positive = 0.75,
    reach: Positive = 4.0,
    friction: NonNegative = 3.0,
    damping: NonNegative = 5.0,
    turn_friction: NonNegative = 1.5,
    turn_damping: NonNegative = 1.0,
    handle: Handle = _BAR,
    density: Positive = 700.0,
    color: Color = (0.24, 0.42, 0.55),
    frame_color: Color = (0.75, 0.76, 0.78),
) -> ImportedModel:
    """A cart whose frame is on the ground amid its casters; its bar is at its +x end, and who pushes it stands there.

    Joints: `along` and `aside`, how far it has rolled along x and y from where it was put, and `body`, its turn about
    the vertical. They stand for the casters, which touch nothing: the resistance to rolling is theirs. A
    mark on the ground stays where the cart was put: the object is `fixed: true`. Frames:
    `body.handle`, amid the bar, x towards who pushes and z along the bar; `body.deck`, amid the upper face of the deck.

    Args:
        size: length, width and thickness of the deck [m].
        deck: height of its upper face [m].
        bar_height: of the middle of the bar [m].
        reach: how far it rolls to each side [m].
        friction: that resists rolling, along each axis [N].
        damping: [N s/m].
        turn_friction: that resists turning [N m].
        turn_damping: [N m s/rad].
        handle: the bar.
        density: of deck and posts [kg/m^3].
        color: of the deck.
        frame_color: of the posts, casters and the bar.

    Raises:
        KeyFault: the deck or the bar is too low, or the bar too wide.
    """
    length, width, thickness = size
    radius = (deck - thickness - _FREE) / 2
    if radius <= 0:
        raise KeyFault(f"a deck {deck:g} m high leaves no room for casters below {thickness:g} m", "deck")
    if bar_height <= deck + handle.radius:
        raise KeyFault(f"the bar at {bar_height:g} m is not above the deck at {deck:g} m", "bar_height")
    made = Assembly("cart")
    radius = min(radius, 0.04)
    made.solid(0, "mark", Cylinder(0.03, 0.002), (0.0, 0.0, 0.002), density, frame_color, collides=False)

    def slide(name: str, axis: Vec3, parent: int) -> int:
        return made.link(
            name,
            ORIGIN,
            JointType.PRISMATIC,
            axis,
            lower=-reach,
            upper=reach,
            friction=friction,
            damping=damping,
            parent=parent,
        )

    along = slide("along", (1.0, 0.0, 0.0), 0)
    aside = slide("aside", (0.0, 1.0, 0.0), along)
    body = made.link(
        "body",
        ORIGIN,
        JointType.REVOLUTE,
        (0.0, 0.0, 1.0),
        lower=-pi,
        upper=pi,
        friction=turn_friction,
        damping=turn_damping,
        parent=aside,
    )
    hub = Box((0.1, 0.1, 0.01))  # the two links that only slide are beams below the deck
    for link, below in ((along, 0.03), (aside, 0.01)):
        made.solid(link, "beam", hub, (0.0, 0.0, deck - thickness - below), density, frame_color, collides=False)
    x, y = length / 2, width / 2
    made.board(body, "deck", (-x, -y, deck - thickness), (x, y, deck), density, color)
    stem = (deck - thickness - _FREE - 2 * radius) / 2
    for name, sign, side in (
        ("front_left", -1, -1),
        ("front_right", -1, 1),
        ("back_left", 1, -1),
        ("back_right", 1, 1),
    ):
        place = (sign * (x - 0.05), side * (y - 0.05))
        ball = (*place, _FREE + radius)
        made.solid(body, f"caster_{name}", Sphere(radius), ball, density, frame_color, collides=False)
        if stem > 0:
            middle = (*place, _FREE + 2 * radius + stem)
            made.solid(body, f"stem_{name}", Cylinder(0.012, stem), middle, density, frame_color, collides=False)
    for name, side in (("post_left", -1), ("post_right", 1)):
        low, high = (x - _POST, side * y, deck), (x, side * (y - _POST), bar_height + _POST)
        first = (low[0], min(low[1], high[1]), low[2])
        made.board(body, name, first, (high[0], max(low[1], high[1]), high[2]), density, frame_color)
    rail = (x - _POST, -y + _POST, bar_height - _POST / 2), (x, y - _POST, bar_height + _POST / 2)
    made.board(body, "rail", *rail, density, frame_color)
    add_handle(made, body, handle, (x, 0.0, bar_height), (width, 0.1), frame_color, upright=False, link="body")
    made.site(body, "body.deck", (0.0, 0.0, deck))
    return made.model()
