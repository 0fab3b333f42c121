"""A bowl: a flared wall of boards in a ring, and a bottom."""

from math import atan2, cos, hypot, pi, sin, tan

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.math import pose as P
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Cylinder
from anysim_assets.assembly import Assembly
from anysim_schemas.base import Color, Positive
from anysim_schemas.errors import KeyFault

_SEGMENTS = 16  # boards of the wall: at the rim, its corners are 2 % of the radius beyond their middles


def bowl(
    *,
    radius: Positive = 0.08,
    foot: Positive = 0.04,
    height: Positive = 0.06,
    wall: Positive = 0.005,
    density: Positive = 1200.0,
    color: Color = (0.86, 0.87, 0.90),
) -> ImportedModel:
    """A bowl; its frame is in the middle of its bottom, z up.

    Its one link is `base`. Frames: `inside`, the middle of its floor; `rim`, the middle of its opening. Affordance:
    `rim`; as every free thing also `body`. It is made of convex pieces, so that what is in it stays in it on every
    engine.

    Args:
        radius: of the opening, inside [m].
        foot: radius of the bottom [m].
        height: [m].
        wall: thickness of wall and bottom [m].
        density: [kg/m^3].
        color: of the bowl.

    Raises:
        KeyFault: the parts do not fit.
    """
    if foot >= radius:
        raise KeyFault(f"a foot of radius {foot:g} m is not narrower than an opening of {radius:g} m", "foot")
    if wall >= min(height / 2, foot / 2):
        raise KeyFault(f"walls of {wall:g} m leave no room in a height of {height:g} m", "wall")
    body = Assembly("bowl")
    body.solid(0, "bottom", Cylinder(foot, wall / 2), (0.0, 0.0, wall / 2), density, color)
    out, up = radius - foot, height - wall
    lean = atan2(out, up)
    # the inner side goes from the edge of the floor to the rim
    middle = ((radius + foot) / 2 + wall / 2 * cos(lean), (height + wall) / 2 - wall / 2 * sin(lean))
    board = Box((wall / 2, radius * tan(pi / _SEGMENTS), hypot(out, up) / 2))
    leaning = P.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(lean))
    for i in range(_SEGMENTS):
        angle = 2 * pi * i / _SEGMENTS
        turn = P.multiply(P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(angle)), leaning)
        x, y, z, w = turn.tolist()
        at = (middle[0] * cos(angle), middle[0] * sin(angle), middle[1])
        body.solid(0, f"wall_{i + 1}", board, at, density, color, (x, y, z, w))
    body.site(0, "inside", (0.0, 0.0, wall))
    body.site(0, "rim", (0.0, 0.0, height))
    walls = tuple(f"base.wall_{i + 1}" for i in range(_SEGMENTS))
    body.afford(Affordance("rim", AffordanceKind.RIM, "rim", walls, ("carry",), ((0.0, 0.0, -1.0),)))
    return body.model()
