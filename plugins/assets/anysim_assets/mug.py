"""A mug: a wall of boards in a ring, a bottom, and a handle."""

from math import cos, pi, sin, tan

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.math import pose as P
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Capsule, Cylinder, Vec3
from anysim_assets.assembly import Assembly, turned
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault

_SEGMENTS = 16  # boards of the wall: outside, its corners are 2 % of the radius beyond their middles
_SHARE = 0.6  # of the height, that the handle's bar has
_TILT = 1.2  # [rad] of a hand about the handle's bar, to each side


def mug(
    *,
    radius: Positive = 0.038,
    height: Positive = 0.09,
    wall: Positive = 0.004,
    bottom: Positive = 0.006,
    handle_radius: Positive = 0.005,
    handle_reach: Positive = 0.03,
    density: Positive = 2400.0,
    color: Color = (0.86, 0.87, 0.90),
    handle_color: Color = (0.25, 0.35, 0.60),
) -> ImportedModel:
    """A mug; its frame is in the middle of the bottom, z up, and its handle is at +x.

    Its one link is `base`. Frames: `inside`, the middle of its floor; `rim`, the middle of its opening; `handle`, the
    middle of the handle's bar, x away from the mug and z along the bar. Affordances: `handle` and `rim`; as every free
    thing also `body`. It is made of convex pieces, so that what is in it stays in it on every engine.

    Args:
        radius: of the outside [m].
        height: [m].
        wall: thickness [m].
        bottom: thickness [m].
        handle_radius: of the handle's round section [m].
        handle_reach: from the outside to the middle of the handle's bar [m].
        density: of all parts [kg/m^3], that of ceramics.
        color: of the mug.
        handle_color: of the handle.

    Raises:
        KeyFault: the parts do not fit.
    """
    if wall >= radius / 2:
        raise KeyFault(f"a wall of {wall:g} m leaves no room in a radius of {radius:g} m", "wall")
    if bottom >= height / 2:
        raise KeyFault(f"a bottom of {bottom:g} m leaves no room in a height of {height:g} m", "bottom")
    if handle_reach <= 2 * handle_radius or _SHARE * height <= 4 * handle_radius:
        raise KeyFault(f"a handle of radius {handle_radius:g} m leaves no room for fingers", "handle_radius")
    body = Assembly("mug")
    body.solid(0, "bottom", Cylinder(radius, bottom / 2), (0.0, 0.0, bottom / 2), density, color)
    tall, middle = height - bottom, radius - wall / 2
    board = Box((wall / 2, middle * tan(pi / _SEGMENTS), tall / 2))
    for i in range(_SEGMENTS):
        angle = 2 * pi * (i + 0.5) / _SEGMENTS  # the handle is where two boards meet, not at a corner of the count
        at = (middle * cos(angle), middle * sin(angle), bottom + tall / 2)
        body.solid(0, f"wall_{i + 1}", board, at, density, color, turned((0.0, 0.0, 1.0), angle))
    bar, reach, level = _SHARE * height / 2 - handle_radius, radius + handle_reach, height / 2

    def rod(name: str, at: Vec3, half: float, lying: bool) -> None:
        x, y, z, w = P.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(pi / 2 if lying else 0.0)).tolist()
        body.solid(0, name, Capsule(handle_radius, half), at, density, handle_color, (x, y, z, w))

    arm = handle_reach / 2 - handle_radius  # its round ends touch the wall and overlap the bar
    for name, side in (("arm_low", -1.0), ("arm_high", 1.0)):
        rod(name, (radius + handle_reach / 2, 0.0, level + side * bar), arm, True)
    rod("bar", (reach, 0.0, level), bar, False)
    body.site(0, "inside", (0.0, 0.0, bottom))
    body.site(0, "rim", (0.0, 0.0, height))
    body.site(0, "handle", (reach, 0.0, level))
    walls = tuple(f"base.wall_{i + 1}" for i in range(_SEGMENTS))
    inwards, down = (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    body.afford(
        Affordance(
            "handle", AffordanceKind.HANDLE, "handle", ("base.bar",), ("carry", "pour"), (inwards,), (-_TILT, _TILT)
        )
    )
    body.afford(Affordance("rim", AffordanceKind.RIM, "rim", walls, ("carry",), (down,)))
    return body.model()
