"""Handles on fronts and lids, and levers on doors."""

from math import pi

from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Capsule, Cylinder, JointType, Vec3
from anysim_assets.assembly import Assembly, Colour, turned
from anysim_assets.parameters import Angle, Handle
from anysim_schemas.errors import KeyFault

_ALONG_X = turned((0.0, 1.0, 0.0), pi / 2)
_ALONG_Y = turned((1.0, 0.0, 0.0), -pi / 2)
_POST = 0.6  # radius of a post or stem, in radii of the bar
_TILT = 0.7  # [rad] of a hand about a bar, to each side
_KNOB = 2.0  # radius of a knob's disc, in radii of the handle
_HELD = 2 / 3  # of a lever, from its axis to where it is held
_FRICTION, _DAMPING = 0.1, 0.05  # of a lever [N m], [N m s/rad]: it bears its own weight


def add_handle(
    assembly: Assembly,
    body: int,
    handle: Handle,
    at: Vec3,
    room: tuple[float, float],
    color: Colour,
    *,
    upright: bool,
    link: str,
) -> None:
    """A handle on a face whose outward normal is the link's +x, around the point `at` of the link.

    The frame `LINK.handle` lies in the middle of the bar or disc: x points away from the face, z along the bar. The
    affordance of the same name is taken hold of from the front.

    Args:
        assembly: what it is added to.
        body: the link that carries it.
        handle: what it is like.
        at: the middle of where it is mounted, in the link's frame [m].
        room: what there is for it along the link's y and z [m].
        color: of all its parts.
        upright: whether a bar whose direction is `auto` stands upright.
        link: the name of the link.

    Raises:
        KeyFault: it is larger than the room.
    """
    if handle.style == "none":
        return
    vertical = handle.direction == "vertical" or (handle.direction == "auto" and upright)
    knob = handle.style == "knob"
    across = 2 * handle.radius * (_KNOB if knob else 1.0)
    along = across if knob else handle.length + 2 * handle.radius
    needed = (across, along) if vertical else (along, across)
    for have, want, word in zip(room, needed, ("wide", "high"), strict=True):
        if want > have:
            raise KeyFault(
                f"the handle of {link} is {want:g} m {word}, and there are {have:g} m for it; give a smaller one, or "
                "`style: none`",
                "handle",
            )
    if handle.standoff <= handle.radius:
        raise KeyFault(
            f"a handle of radius {handle.radius:g} m needs a larger standoff than {handle.standoff:g} m",
            "handle",
            "standoff",
        )
    x, y, z = at
    stem = handle.standoff - handle.radius  # posts end where the bar begins: no mass is counted twice

    def post(name: str, dy: float, dz: float) -> None:
        shape = Cylinder(_POST * handle.radius, stem / 2)
        assembly.solid(body, name, shape, (x + stem / 2, y + dy, z + dz), handle.density, color, _ALONG_X)

    middle = (x + handle.standoff, y, z)
    along_z = vertical or knob
    if knob:
        post("stem", 0.0, 0.0)
        disc = Cylinder(_KNOB * handle.radius, handle.radius)
        assembly.solid(body, "knob", disc, middle, handle.density, color, _ALONG_X)
    else:
        reach = handle.length / 2 - _POST * handle.radius
        if reach <= 0:
            raise KeyFault(f"a bar of {handle.length:g} m is too short for its posts", "handle", "length")
        post("post_low", *((0.0, -reach) if vertical else (-reach, 0.0)))
        post("post_high", *((0.0, reach) if vertical else (reach, 0.0)))
        bar = Capsule(handle.radius, handle.length / 2)
        assembly.solid(
            body, "bar", bar, middle, handle.density, color, turned((0.0, 0.0, 1.0), 0.0) if vertical else _ALONG_Y
        )
    assembly.site(body, f"{link}.handle", middle, turned((1.0, 0.0, 0.0), 0.0) if along_z else _ALONG_Y)
    # a bar is taken from the front, tilted about itself as far as the fingers stay clear of the face
    approach = (-1.0, 0.0, 0.0)
    piece = f"{link}.knob" if knob else f"{link}.bar"
    roll = (0.0, 0.0) if knob else (-_TILT, _TILT)
    assembly.afford(
        Affordance(
            f"{link}.handle",
            AffordanceKind.HANDLE,
            f"{link}.handle",
            (piece,),
            ("open", "close"),
            (approach,),
            roll,
            link,
        )
    )


def add_lever(
    assembly: Assembly, body: int, handle: Handle, at: Vec3, room: float, range: Angle, color: Colour, *, link: str
) -> None:
    """A bar at one end of which is an axis along the link's +x, on a face whose outward normal that is.

    The new link and joint `lever` has its axis at the point `at` of the link; at zero the bar points to the link's +y,
    and positive is down. The affordance `lever.handle` is taken hold of from the front; the frame has x away from the
    face and z along the bar. Of the link, `LINK.handle` is where that is at zero.

    Raises:
        KeyFault: it is no bar, or longer than the room along the link's +y [m].
    """
    if handle.style != "bar":
        raise KeyFault(f"a lever is a bar, not `{handle.style}`; leave `lever` out", "handle", "style")
    if handle.length + handle.radius > room:
        raise KeyFault(f"a lever of {handle.length:g} m is longer than the {room:g} m for it", "handle", "length")
    stem = handle.standoff - handle.radius
    if stem <= 0:
        raise KeyFault(f"a lever of radius {handle.radius:g} m needs a larger standoff", "handle", "standoff")
    x, y, z = at
    held = (handle.standoff, _HELD * handle.length, 0.0)
    assembly.site(body, f"{link}.handle", (x + held[0], y + held[1], z), _ALONG_Y)
    down, resistance = (-1.0, 0.0, 0.0), {"friction": _FRICTION, "damping": _DAMPING}
    lever = assembly.link("lever", at, JointType.REVOLUTE, down, lower=0.0, upper=range, parent=body, **resistance)
    stem_shape, bar = Cylinder(handle.radius, stem / 2), Capsule(handle.radius, handle.length / 2)
    assembly.solid(lever, "stem", stem_shape, (stem / 2, 0.0, 0.0), handle.density, color, _ALONG_X)
    middle = (handle.standoff, handle.length / 2, 0.0)
    assembly.solid(lever, "bar", bar, middle, handle.density, color, _ALONG_Y)
    assembly.site(lever, "lever.handle", held, _ALONG_Y)
    name, approach = "lever.handle", (-1.0, 0.0, 0.0)
    kind, roll = AffordanceKind.LEVER, (-_TILT, _TILT)
    assembly.afford(Affordance(name, kind, name, ("lever.bar",), ("turn", "open"), (approach,), roll, "lever"))
