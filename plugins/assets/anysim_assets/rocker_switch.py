"""A rocker switch on a housing."""

from math import cos, sin, tan

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, JointType
from anysim_assets.assembly import Assembly, turned
from anysim_assets.parameters import Angle
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault


def rocker_switch(
    *,
    size: Positive = 0.1,
    height: Positive = 0.03,
    length: Positive = 0.07,
    width: Positive = 0.03,
    thickness: Positive = 0.01,
    range: Angle = 0.6,
    gap: Positive = 0.002,
    friction: NonNegative = 0.03,
    damping: NonNegative = 0.005,
    density: Positive = 1100.0,
    color: Color = (0.88, 0.88, 0.86),
    rocker_color: Color = (0.80, 0.10, 0.08),
) -> ImportedModel:
    """A switch whose rocker tilts about y on a housing; its frame is in the middle of the housing's bottom.

    The joint `rocker` is at zero where the switch is off and the end at +x is up, and at `range` where that end is
    down. Dry friction keeps it where it is. The frame `rocker.on` is on the upper face at that end, z out of it, and
    `rocker.off` at the other end.

    Args:
        size: edge length of the housing [m].
        height: of the housing [m].
        length: of the rocker, along x when it is level [m].
        width: of the rocker [m].
        thickness: of the rocker [m].
        range: how far it tilts from off to on [rad].
        gap: between the lowered end and the housing [m].
        friction: dry friction of the rocker [N m].
        damping: of the rocker [N m s/rad].
        density: [kg/m^3].
        color: of the housing.
        rocker_color: of the rocker.

    Raises:
        KeyFault: the rocker is larger than the housing, or tilts too far.
    """
    if max(length, width) > size:
        raise KeyFault(f"a rocker of {length:g} x {width:g} m is larger than a housing of {size:g} m", "length")
    if range > 1.5:
        raise KeyFault(f"a rocker tilts by at most 1.5 rad, not {range:g}", "range")
    half = range / 2
    axis = height + gap + length / 2 * sin(half) + thickness / 2 * cos(half)  # lowered, an end is just off the housing
    body = Assembly("rocker_switch")
    body.solid(0, "housing", Box((size / 2, size / 2, height / 2)), (0.0, 0.0, height / 2), density, color)
    post = (axis - thickness / 2 / cos(half) - gap - height) / 2
    if post <= 0:
        raise KeyFault(f"a rocker of {length:g} m that is {thickness:g} m thick rests on its housing", "thickness")
    narrow = min(gap / 2 / tan(half), length / 8)  # a tilted rocker stays clear of it
    body.solid(0, "post", Box((narrow, width / 2, post)), (0.0, 0.0, height + post), density, color)
    link = body.link(
        "rocker",
        (0.0, 0.0, axis),
        JointType.REVOLUTE,
        (0.0, 1.0, 0.0),
        lower=0.0,
        upper=range,
        friction=friction,
        damping=damping,
    )
    raised = turned((0.0, 1.0, 0.0), -half)
    shape = Box((length / 2, width / 2, thickness / 2))
    body.solid(link, "plate", shape, (0.0, 0.0, 0.0), density, rocker_color, raised)
    reach, out = 0.75 * length / 2, thickness / 2
    for name, along in (("rocker.on", reach), ("rocker.off", -reach)):
        # the plate's own x and z, tilted up by half of the range
        place = (along * cos(half) - out * sin(half), 0.0, along * sin(half) + out * cos(half))
        body.site(link, name, place, raised)
        body.afford(Affordance(name, AffordanceKind.BUTTON, name, ("rocker.plate",), ("press",), joint="rocker"))
    body.site(link, "rocker.top", (-out * sin(half), 0.0, out * cos(half)), raised)
    return body.model()
