"""A push button on a housing."""

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Cylinder, JointType
from anysim_assets.assembly import Assembly
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault


def button(
    *,
    size: Positive = 0.1,
    height: Positive = 0.04,
    radius: Positive = 0.02,
    travel: Positive = 0.012,
    gap: Positive = 0.002,
    friction: NonNegative = 0.5,
    damping: NonNegative = 2.0,
    density: Positive = 1100.0,
    color: Color = (0.30, 0.31, 0.33),
    cap_color: Color = (0.80, 0.10, 0.08),
) -> ImportedModel:
    """A button that is pressed along -z; its frame is in the middle of the bottom of its housing.

    The joint `cap` is at zero where the button is out, positive is pressed. A joint has no spring: dry friction keeps
    the cap where it is, and what is to bring it back is a force of the task. The frame `cap.top` is in the middle of
    the cap's upper face, z out of it.

    Args:
        size: edge length of the housing [m].
        height: of the housing [m].
        radius: of the cap [m].
        travel: of the cap [m].
        gap: between the pressed cap and the housing [m].
        friction: dry friction of the cap [N].
        damping: of the cap [N s/m].
        density: [kg/m^3].
        color: of the housing.
        cap_color: of the cap.

    Raises:
        KeyFault: the cap is larger than the housing.
    """
    if 2 * radius > size:
        raise KeyFault(f"a cap of radius {radius:g} m is larger than a housing of {size:g} m", "radius")
    body = Assembly("button")
    body.solid(0, "housing", Box((size / 2, size / 2, height / 2)), (0.0, 0.0, height / 2), density, color)
    bottom = height + travel + gap  # of the cap while it is out
    link = body.link(
        "cap",
        (0.0, 0.0, bottom),
        JointType.PRISMATIC,
        (0.0, 0.0, -1.0),
        lower=0.0,
        upper=travel,
        friction=friction,
        damping=damping,
    )
    thickness = radius / 2
    body.solid(link, "knob", Cylinder(radius, thickness / 2), (0.0, 0.0, thickness / 2), density, cap_color)
    body.site(link, "cap.top", (0.0, 0.0, thickness))
    body.afford(
        Affordance("cap", AffordanceKind.BUTTON, "cap.top", ("cap.knob",), ("press",), joint="cap", depth=travel)
    )
    return body.model()
