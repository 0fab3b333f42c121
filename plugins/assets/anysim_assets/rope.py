"""A rope: a chain of capsules that bend at hinges about z and y by turns."""

from math import pi
from typing import Annotated

from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Capsule, Cylinder, JointType
from anysim_assets.assembly import Assembly, turned
from anysim_assets.parameters import Angle
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault

_BEND = pi / 3


def rope(
    *,
    length: Positive = 0.4,
    radius: Positive = 0.01,
    links: Annotated[int, Field(ge=2, le=60)] = 16,
    bend: Angle = _BEND,
    friction: NonNegative = 0.0001,
    damping: NonNegative = 0.0002,
    density: Positive = 500.0,
    color: Color = (0.80, 0.62, 0.30),
) -> ImportedModel:
    """A rope that lies along +x; its frame is in the middle of its first link, z up.

    It is a chain of round rods of equal length. Joints `side_1`, `side_2`, … about z and `up_1`, `up_2`, … about y take
    turns, so that each pair bends to all sides; at zero the rope is straight. Frames: `first` and `last` at its ends,
    `middle` where the two halves meet.

    Args:
        length: from end to end, of the middle of the rods [m].
        radius: [m].
        links: how many rods.
        bend: how far each joint turns to either side [rad].
        friction: dry friction of each joint [N m].
        damping: of each joint [N m s/rad].
        density: [kg/m^3].
        color: of the rope.

    Raises:
        KeyFault: the links are too short for their radius.
    """
    pitch = length / links
    if pitch <= 0.5 * radius:
        raise KeyFault(f"{links} links in {length:g} m are shorter than half of the radius of {radius:g} m", "links")
    body = Assembly("rope")
    along = turned((0.0, 1.0, 0.0), pi / 2)  # takes a capsule's z to x
    rod, mass = Capsule(radius, pitch / 2), Cylinder(radius, pitch / 2)  # the round ends overlap
    bodies = [0]
    for number in range(links - 1):
        name, axis = ("up", (0.0, 1.0, 0.0)) if number % 2 else ("side", (0.0, 0.0, 1.0))
        bodies.append(
            body.link(
                f"{name}_{number // 2 + 1}",
                (pitch if number else pitch / 2, 0.0, 0.0),
                JointType.REVOLUTE,
                axis,
                lower=-bend,
                upper=bend,
                friction=friction,
                damping=damping,
                parent=bodies[-1],
            )
        )
    for number, link in enumerate(bodies):
        # a link turns about its beginning, the first one's frame is in its middle
        middle = (pitch / 2 if number else 0.0, 0.0, 0.0)
        body.solid(link, "rod", rod, middle, density, color, along, filled=mass)
    body.site(0, "first", (-pitch / 2, 0.0, 0.0))
    body.site(bodies[links // 2], "middle", (0.0, 0.0, 0.0))
    body.site(bodies[-1], "last", (pitch, 0.0, 0.0))
    for name, rod in (("first", "base.rod"), ("last", f"{body.name_of(bodies[-1])}.rod")):
        body.afford(Affordance(name, AffordanceKind.HANDLE, name, (rod,), ("carry", "drag"), ((0.0, 0.0, -1.0),)))
    return body.model()
