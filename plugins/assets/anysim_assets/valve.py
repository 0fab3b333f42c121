"""A valve: a wheel, bare spokes or a lever on a stem."""

from math import cos, inf, pi, sin
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim.math import pose as P
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Capsule, Cylinder, JointType, Shape
from anysim_assets.assembly import Assembly, turned
from anysim_schemas.base import Color, NonNegative, Number, Positive
from anysim_schemas.errors import KeyFault

_SEGMENTS = 24  # capsules of a rim: their middles leave the circle by 0.9 % of its radius


def valve(
    *,
    style: Literal["wheel", "spokes", "lever"] = "wheel",
    radius: Positive = 0.08,
    thickness: Positive = 0.008,
    spokes: Annotated[int, Field(ge=1, le=12)] = 4,
    height: Positive = 0.12,
    stem_radius: Positive = 0.012,
    base: Positive = 0.12,
    base_height: Positive = 0.02,
    gap: Positive = 0.002,
    limits: tuple[Number, Number] | None = None,
    friction: NonNegative = 0.1,
    damping: NonNegative = 0.02,
    density: Positive = 1200.0,
    color: Color = (0.45, 0.47, 0.50),
    wheel_color: Color = (0.75, 0.12, 0.10),
) -> ImportedModel:
    """A valve whose wheel, spokes or lever turn about +z; its frame is in the middle of the bottom of its base plate.

    The link and joint `wheel` turns without end unless `limits` says otherwise; positive is counter-clockwise, seen
    from above. The frame `wheel.handle` is where the first spoke ends, on the rim if there is one, or at the end of the
    lever; x outwards.

    Args:
        style: a wheel with spokes and a rim, the spokes alone, or one lever.
        radius: from the axis to the middle of the rim, or the length of the spokes or the lever [m].
        thickness: radius of the rim's, spokes' and lever's round section [m].
        spokes: how many.
        height: of the middle of the wheel above the bottom [m].
        stem_radius: of the stem and the hub [m].
        base: edge length of the base plate [m].
        base_height: of the base plate [m].
        gap: between stem and hub [m].
        limits: lowest and highest angle [rad].
        friction: dry friction of the wheel [N m].
        damping: [N m s/rad].
        density: of all parts [kg/m^3].
        color: of the base and the stem.
        wheel_color: of what turns.

    Raises:
        KeyFault: the parts do not fit.
    """
    hub = 1.5 * stem_radius
    stem = height - thickness - gap - base_height
    if stem <= 0:
        raise KeyFault(f"a height of {height:g} m leaves no room for a stem above the base", "height")
    if radius <= hub + 3.5 * thickness:
        raise KeyFault(f"a radius of {radius:g} m leaves no spokes outside of the hub of {hub:g} m", "radius")
    if limits is not None and limits[0] >= limits[1]:
        raise KeyFault(f"the lower limit {limits[0]:g} is not below the upper one {limits[1]:g}", "limits")
    body = Assembly("valve")
    body.solid(0, "plate", Box((base / 2, base / 2, base_height / 2)), (0.0, 0.0, base_height / 2), density, color)
    body.solid(0, "stem", Cylinder(stem_radius, stem / 2), (0.0, 0.0, base_height + stem / 2), density, color)
    lower, upper = limits or (-inf, inf)
    link = body.link(
        "wheel",
        (0.0, 0.0, height),
        JointType.REVOLUTE,
        (0.0, 0.0, 1.0),
        lower=lower,
        upper=upper,
        friction=friction,
        damping=damping,
    )
    body.solid(link, "hub", Cylinder(hub, thickness), (0.0, 0.0, 0.0), density, wheel_color)

    flat = np.array(turned((0.0, 1.0, 0.0), pi / 2))  # takes a capsule's z to x

    def rod(name: str, middle: tuple[float, float], half: float, along: float, mass: Shape | None = None) -> None:
        x, y, z, w = P.multiply(np.array(turned((0.0, 0.0, 1.0), along)), flat).tolist()
        shape = Capsule(thickness, half)
        body.solid(link, name, shape, (*middle, 0.0), density, wheel_color, (x, y, z, w), filled=mass)

    arms = 1 if style == "lever" else spokes
    # a spoke ends where the rim begins, without one with its round end at the radius
    inner, rimmed = hub + thickness, style == "wheel"
    outer = radius - 2 * thickness if rimmed else radius - thickness
    for i in range(arms):
        angle, reach = 2 * pi * i / arms, (inner + outer) / 2
        rod(f"spoke_{i + 1}", (reach * cos(angle), reach * sin(angle)), (outer - inner) / 2, angle)
    if rimmed:
        for i in range(_SEGMENTS):
            angle = 2 * pi * (i + 0.5) / _SEGMENTS
            half = radius * sin(pi / _SEGMENTS)
            middle = (radius * cos(angle), radius * sin(angle))
            rod(f"rim_{i + 1}", middle, half, angle + pi / 2, Cylinder(thickness, half))  # its round ends overlap
    body.site(link, "wheel.handle", (radius, 0.0, 0.0))
    body.afford(
        Affordance(
            "wheel.handle",
            AffordanceKind.RIM if rimmed else AffordanceKind.LEVER,
            "wheel.handle",
            tuple(f"wheel.rim_{i + 1}" for i in range(_SEGMENTS)) if rimmed else ("wheel.spoke_1",),
            ("turn",),
            ((0.0, 0.0, -1.0),),
            joint="wheel",
        )
    )
    return body.model()
