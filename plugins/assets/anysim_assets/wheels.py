"""Parts of wheeled bases: wheels, castors, and the body between them."""

from dataclasses import replace
from itertools import combinations
from math import inf, pi
from typing import NamedTuple

from anysim.assets.model import ImportedModel
from anysim.model.world import Box, Cylinder, JointType, Sphere, Surface, Vec3
from anysim_assets.assembly import Assembly, Colour, turned
from anysim_schemas.errors import KeyFault

TYRE = Surface(friction=1.0)
"""Rubber. Its word counts beside most grounds: the larger friction of a pair holds."""

CASTOR = Surface(friction=0.0, torsional_friction=0.0, rolling_friction=0.0, priority=1)
"""A ball that rolls in every direction, as one that slides without friction; its priority says so on any ground."""

_LYING = turned((1.0, 0.0, 0.0), pi / 2)  # takes a cylinder's z to y
RUBBER = 1200.0  # [kg/m^3]


class Wheel(NamedTuple):
    """A driven wheel: [m], [m], [rad/s], [N m]."""

    radius: float
    width: float
    speed: float
    torque: float
    color: Colour


def add_wheel(base: Assembly, name: str, position: Vec3, wheel: Wheel, *, parent: int = 0) -> None:
    """A wheel about y: the mass and the looks of a cylinder, touching the ground as a sphere about its middle.

    A sphere is round on every engine, where a cylinder is a prism of many sides on one, and touches in one point,
    which does not resist being turned on the spot.
    """
    radius, width, speed, torque, color = wheel
    link = base.link(
        name, position, JointType.REVOLUTE, (0.0, 1.0, 0.0), velocity_limit=speed, effort_limit=torque, parent=parent
    )
    base.solid(link, "rim", Cylinder(radius, width / 2), (0.0, 0.0, 0.0), RUBBER, color, _LYING, collides=False)
    base.contact(link, "tyre", Sphere(radius), (0.0, 0.0, 0.0), TYRE)


def add_steering(base: Assembly, name: str, position: Vec3, *, speed: float, torque: float, limit: float = inf) -> int:
    """The link that turns with a steered wheel about the upright axis through its middle; it has no mass yet."""
    up, turn = (0.0, 0.0, 1.0), JointType.REVOLUTE
    return base.link(name, position, turn, up, lower=-limit, upper=limit, velocity_limit=speed, effort_limit=torque)


def add_castor(base: Assembly, name: str, x: float, y: float, radius: float, ground: float, color: Colour) -> None:
    """A ball under the body whose lowest point is at the height `ground` of the root's frame."""
    middle = (x, y, ground + radius)
    base.solid(0, f"{name}.ball", Sphere(radius), middle, RUBBER, color, collides=False)
    base.contact(0, name, Sphere(radius), middle, CASTOR)


def add_body(base: Assembly, size: Vec3, bottom: float, middle: float, mass: float, color: Colour) -> None:
    """The body, a box over the root's frame moved by `middle` along x, and the frame `top` in the middle of its top."""
    x, y, z = size
    base.solid(0, "body", Box((x / 2, y / 2, z / 2)), (middle, 0.0, bottom + z / 2), mass / (x * y * z), color)
    base.site(0, "top", (middle, 0.0, bottom + z))


def made(base: Assembly) -> ImportedModel:
    """The model, whose parts do not collide with each other: the spheres of wheels reach into the body."""
    model = base.model()
    return replace(model, excluded_pairs=frozenset(combinations(range(len(model.bodies)), 2)))


def check_bottom(size: Vec3, clearance: float, radius: float) -> float:
    """The height of the body's bottom in the frame of the wheels' axles [m].

    Raises:
        KeyFault: the body would hang on the ground.
    """
    if clearance <= 0:
        raise KeyFault(f"a clearance of {clearance:g} m leaves the body on the ground", "clearance")
    if clearance + size[2] < radius:
        raise KeyFault(f"the top of the body is below the axles, {radius:g} m above the ground", "size")
    return clearance - radius
