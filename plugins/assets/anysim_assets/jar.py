"""A jar with a cap that is screwed on."""

from math import pi

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import ORIGIN, Cylinder, JointType
from anysim_assets.assembly import Assembly
from anysim_schemas.base import Color, NonNegative, Positive

_MARK = 0.0005
"""[m] the mark stands out of the cap."""


def jar(
    *,
    radius: Positive = 0.03,
    height: Positive = 0.1,
    cap_radius: Positive = 0.032,
    cap_height: Positive = 0.024,
    turns: Positive = 1.5,
    gap: Positive = 0.002,
    friction: NonNegative = 0.1,
    damping: NonNegative = 0.02,
    density: Positive = 1100.0,
    color: Color = (0.62, 0.76, 0.80),
    cap_color: Color = (0.72, 0.16, 0.12),
    mark_color: Color = (0.95, 0.95, 0.92),
) -> ImportedModel:
    """A jar whose frame is in the middle of its bottom, with a cap that turns as on a thread.

    The link and joint `cap` turns clockwise, seen from above, from 0, where the thread takes hold, to `turns` turns,
    where it is tight. The thread is this hinge: the cap neither sinks, tilts nor comes off, and how far a thread would
    have taken it follows from how far it has turned. The frame `cap.handle` is in the middle of the cap, z up.

    Args:
        radius: of the jar [m].
        height: of the jar [m].
        cap_radius: of the cap [m].
        cap_height: of the cap [m].
        turns: how far the cap turns from loose to tight.
        gap: between the jar and the cap [m].
        friction: dry friction of the thread [N m].
        damping: of the thread [N m s/rad].
        density: of all parts [kg/m^3].
        color: of the jar.
        cap_color: of the cap.
        mark_color: of the mark on the cap that shows how far it is turned.
    """
    body = Assembly("jar")
    body.solid(0, "glass", Cylinder(radius, height / 2), (0.0, 0.0, height / 2), density, color)
    half = cap_height / 2
    cap = body.link(
        "cap",
        (0.0, 0.0, height + gap + half),
        JointType.REVOLUTE,
        (0.0, 0.0, -1.0),
        lower=0.0,
        upper=2 * pi * turns,
        friction=friction,
        damping=damping,
    )
    body.solid(cap, "lid", Cylinder(cap_radius, half), ORIGIN, density, cap_color)
    wide = 0.08 * cap_radius
    body.board(
        cap, "mark", (0.1 * cap_radius, -wide, half), (0.9 * cap_radius, wide, half + _MARK), density, mark_color
    )
    body.site(cap, "cap.handle", ORIGIN)
    body.afford(
        Affordance("cap", AffordanceKind.BODY, "cap.handle", ("cap.lid",), ("turn",), ((0.0, 0.0, -1.0),), joint="cap")
    )
    return body.model()
