"""Spur gears: one that is put over a shaft, and the stand with that shaft between two gears that turn."""

from math import cos, pi, sin
from typing import Annotated

from pydantic import Field

from anysim.assets.model import ImportedModel
from anysim.model.affordances import Affordance, AffordanceKind
from anysim.model.world import Box, Cylinder, JointType
from anysim_assets.assembly import Assembly, ring, turned
from anysim_schemas.base import Color, NonNegative, Positive
from anysim_schemas.errors import KeyFault

Teeth = Annotated[int, Field(ge=8, le=48, multiple_of=4)]
ADDENDUM, DEDENDUM = 1.0, 1.25
"""Of a tooth beyond and within the pitch circle, in modules (ISO 53)."""
THICKNESS = 1.05
"""Of a tooth, in modules: two thirds of half a pitch, since straight teeth need more play than involute ones."""
PIECES = 12
"""Boxes of a hub."""


def gear(
    *,
    teeth: Teeth = 12,
    module: Positive = 0.004,
    shaft: Positive = 0.016,
    clearance: Positive = 0.0015,
    height: Positive = 0.014,
    hub: Positive = 0.036,
    hub_height: Positive = 0.045,
    density: Positive = 1100.0,
    color: Color = (0.78, 0.62, 0.20),
) -> ImportedModel:
    """A gear with a hub that a gripper holds and a hole through it; its frame is in the middle of its bottom.

    The hub is a ring of boxes, a tooth is a box that points outwards; the first one points along x. Frames: `hole`, the
    lower end of the hole, and `mouth`, its upper end, both with z up.

    Args:
        teeth: how many, a multiple of 4.
        module: pitch diameter by the number of teeth [m].
        shaft: diameter of the shaft that the hole is for [m].
        clearance: between the shaft in the middle and the hub's boxes [m].
        height: of the teeth [m].
        hub: outer diameter of the hub [m].
        hub_height: [m].
        density: [kg/m^3].
        color: of the gear.

    Raises:
        KeyFault: the hole, the hub and the teeth do not fit into each other.
    """
    inner, outer = shaft / 2 + clearance, hub / 2
    root = module * (teeth / 2 - DEDENDUM)
    if inner >= 0.9 * outer:
        raise KeyFault(f"a hole of {2 * inner:g} m leaves no wall in a hub of {hub:g} m", "hub")
    if outer > root:
        raise KeyFault(f"a hub of {hub:g} m is wider than the {2 * root:g} m between the teeth", "hub")
    if hub_height < height:
        raise KeyFault(f"the hub of {hub_height:g} m is lower than the teeth of {height:g} m", "hub_height")
    body = Assembly("gear")
    ring(body, 0, "hub", (inner, outer), hub_height, PIECES, density, color)
    _teeth(body, 0, teeth, module, outer, height, 0.0, density, color)
    body.site(0, "hole", (0.0, 0.0, 0.0))
    body.site(0, "mouth", (0.0, 0.0, hub_height))
    hole = Affordance("hole", AffordanceKind.HOLE, "mouth", use=("insert",), depth=hub_height, clearance=clearance)
    body.afford(hole)
    return body.model()


def gear_stand(
    *,
    teeth: Teeth = 12,
    module: Positive = 0.004,
    shaft: Positive = 0.016,
    shaft_height: Positive = 0.03,
    height: Positive = 0.014,
    play: Positive = 0.001,
    plate: Positive = 0.01,
    friction: NonNegative = 0.002,
    damping: NonNegative = 0.001,
    density: Positive = 1100.0,
    color: Color = (0.30, 0.31, 0.33),
    gear_color: Color = (0.35, 0.42, 0.55),
) -> ImportedModel:
    """A plate with a shaft in its middle and a gear on either side along y; its frame is in the middle of its bottom.

    The gears, links and joints `left` (at +y) and `right`, turn about z without end. At zero a gear on the shaft meshes
    with both if one of its teeth points along y. Frames: `shaft`, the foot of the shaft, and `shaft_head`, its upper
    end, both with z up.

    Args:
        teeth: of each gear and of the one that is to be put on the shaft, a multiple of 4.
        module: pitch diameter by the number of teeth [m].
        shaft: diameter of the shaft [m].
        shaft_height: of the shaft over the plate [m].
        height: of the teeth [m].
        play: by which the axes are farther apart than the pitch circles ask for [m].
        plate: thickness of the plate [m].
        friction: dry friction of each gear [N m].
        damping: of each gear [N m s/rad].
        density: [kg/m^3].
        color: of the plate and the shaft.
        gear_color: of the gears.

    Raises:
        KeyFault: the shaft is wider than what is between the teeth.
    """
    root, apart = module * (teeth / 2 - DEDENDUM), module * teeth + play
    if shaft / 2 >= root:
        raise KeyFault(f"a shaft of {shaft:g} m is wider than the {2 * root:g} m between the teeth", "shaft")
    body = Assembly("gear_stand")
    tip = module * (teeth / 2 + ADDENDUM)
    body.solid(0, "plate", Box((1.2 * tip, apart + 1.1 * tip, plate / 2)), (0.0, 0.0, plate / 2), density, color)
    foot = (0.0, 0.0, plate + shaft_height / 2)
    body.solid(0, "shaft", Cylinder(shaft / 2, shaft_height / 2), foot, density, color)
    body.site(0, "shaft", (0.0, 0.0, plate))
    body.site(0, "shaft_head", (0.0, 0.0, plate + shaft_height))
    body.afford(Affordance("shaft", AffordanceKind.TIP, "shaft_head", ("base.shaft",), ("insert",)))
    for name, side in (("left", 1.0), ("right", -1.0)):
        above = plate + 0.1 * height
        link = body.link(
            name, (0.0, side * apart, above), JointType.REVOLUTE, (0.0, 0.0, 1.0), friction=friction, damping=damping
        )
        body.solid(link, "disc", Cylinder(root, height / 2), (0.0, 0.0, height / 2), density, gear_color)
        _teeth(body, link, teeth, module, root, height, pi / teeth, density, gear_color)
        down = ((0.0, 0.0, -1.0),)
        body.afford(Affordance(name, AffordanceKind.RIM, name, (f"{name}.disc",), ("turn",), down, joint=name))
    return body.model()


def _teeth(
    body: Assembly,
    link: int,
    count: int,
    module: float,
    root: float,
    height: float,
    first: float,
    density: float,
    color: Color,
) -> None:
    """Teeth from the radius `root` to their tips, the first at the angle `first`."""
    tip = module * (count / 2 + ADDENDUM)
    half, middle = (tip - root) / 2, (tip + root) / 2
    box = Box((half, THICKNESS * module / 2, height / 2))
    for i in range(count):
        angle = first + 2 * pi * i / count
        place = (middle * cos(angle), middle * sin(angle), height / 2)
        body.solid(link, f"tooth_{i + 1}", box, place, density, color, turned((0.0, 0.0, 1.0), angle))
