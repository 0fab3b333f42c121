"""A tap with a lever on top of it."""

from math import pi

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Cylinder, JointType
from anysim_assets.assembly import Assembly, turned
from anysim_assets.parameters import Angle
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault


def faucet(
    *,
    height: Positive = 0.12,
    column_radius: Positive = 0.018,
    base: Positive = 0.1,
    base_height: Positive = 0.015,
    spout: Positive = 0.09,
    lever: Positive = 0.09,
    thickness: Positive = 0.016,
    range: Angle = 1.745,
    gap: Positive = 0.002,
    friction: NonNegative = 0.1,
    damping: NonNegative = 0.02,
    density: Positive = 2700.0,
    color: Color = (0.75, 0.77, 0.80),
    lever_color: Color = (0.12, 0.35, 0.70),
) -> ImportedModel:
    """A tap on a base plate, its frame in the middle of the plate's bottom; the spout points along -x.

    The link and joint `lever` turns about +z from 0, where it points along +x and the tap is shut, to `range`. The
    frame `lever.handle` is at the lever's end, x away from the axis.

    Args:
        height: of the lever's middle above the bottom [m].
        column_radius: of the body of the tap [m].
        base: edge length of the base plate [m].
        base_height: of the base plate [m].
        spout: from the axis to the spout's end [m].
        lever: from the axis to the lever's end [m].
        thickness: width and height of the lever, and of the spout [m].
        range: how far the lever turns [rad].
        gap: between the column and the lever [m].
        friction: dry friction of the lever [N m].
        damping: of the lever [N m s/rad].
        density: [kg/m^3]; the default is aluminium's.
        color: of the base, the column and the spout.
        lever_color: of the lever.

    Raises:
        KeyFault: the parts do not fit.
    """
    half, wide = thickness / 2, 1.5 * thickness
    top = height - half - gap
    if top - base_height <= 3 * thickness:
        raise KeyFault(f"a height of {height:g} m leaves no room for a column with a spout above the base", "height")
    if 2 * column_radius >= base:
        raise KeyFault(f"a base of {base:g} m does not carry a column of radius {column_radius:g} m", "base")
    for name, length in (("spout", spout), ("lever", lever)):
        if length <= column_radius + 2 * thickness:
            raise KeyFault(f"a {name} of {length:g} m does not reach out of a column of {column_radius:g} m", name)
    body = Assembly("faucet")
    body.board(0, "plate", (-base / 2, -base / 2, 0.0), (base / 2, base / 2, base_height), density, color)
    column = (top - base_height) / 2
    body.solid(0, "column", Cylinder(column_radius, column), (0.0, 0.0, base_height + column), density, color)
    low = base_height + column - half
    body.board(0, "spout", (-spout, -half, low), (-column_radius, half, low + thickness), density, color)
    body.board(0, "outlet", (-spout, -half, low - half), (-spout + thickness, half, low), density, color)
    link = body.link(
        "lever",
        (0.0, 0.0, height),
        JointType.REVOLUTE,
        (0.0, 0.0, 1.0),
        lower=0.0,
        upper=range,
        friction=friction,
        damping=damping,
    )
    body.board(
        link, "hub", (-column_radius, -column_radius, -half), (column_radius, column_radius, half), density, lever_color
    )
    body.board(link, "arm", (column_radius, -half, -half), (lever - thickness, half, half), density, lever_color)
    body.board(link, "end", (lever - thickness, -wide / 2, -half), (lever, wide / 2, half), density, lever_color)
    body.site(link, "lever.handle", (lever, 0.0, 0.0))
    body.site(0, "outlet", (-spout + half, 0.0, low - half), turned((1.0, 0.0, 0.0), pi))
    body.afford(
        Affordance(
            "lever.handle",
            AffordanceKind.LEVER,
            "lever.handle",
            ("lever.arm", "lever.end"),
            ("turn",),
            ((0.0, 0.0, -1.0),),
            joint="lever",
        )
    )
    return body.model()
