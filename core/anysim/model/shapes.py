"""Shapes of geoms, and how their surfaces touch. Sizes are half sizes, in metres."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from anysim.conventions import Array

Vec3 = tuple[float, float, float]
HASHED_IF_GIVEN: Mapping[str, str] = MappingProxyType({"hashed": "if given"})
"""Marks a field that came later: worlds that leave it alone keep their hash."""


@dataclass(frozen=True, slots=True)
class Plane:
    """An infinite ground plane, normal +z; `visual_size` is the half extent that is drawn."""

    visual_size: float = 10.0


@dataclass(frozen=True, slots=True)
class Box:
    """A box centred on its frame; `half_size` are half its edge lengths."""

    half_size: Vec3


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball centred on its frame."""

    radius: float


@dataclass(frozen=True, slots=True)
class Capsule:
    """Along z; `half_length` is half the straight part."""

    radius: float
    half_length: float


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Along z."""

    radius: float
    half_length: float


@dataclass(frozen=True, slots=True)
class MeshShape:
    """A mesh of the world by name; as a collision shape it is its convex hull.

    A `concave` one collides triangle by triangle, and is fixed: ground, or, where `bounded`, part of a static thing,
    which has a size, and which is taken for its hull where triangles do not matter.
    """

    mesh: str
    concave: bool = False
    bounded: bool = field(default=False, metadata=HASHED_IF_GIVEN)


@dataclass(frozen=True, slots=True)
class HeightFieldShape:
    """A height field of the world by name, centred on its frame."""

    heightfield: str


Shape = Plane | Box | Sphere | Capsule | Cylinder | MeshShape | HeightFieldShape


def is_ground(shape: Shape) -> bool:
    """Whether a shape is a surface without a volume: it has no bounds or mass, and only what is fixed can have it."""
    return isinstance(shape, Plane | HeightFieldShape) or (
        isinstance(shape, MeshShape) and shape.concave and not shape.bounded
    )


def solid_moments(shape: Shape, mass: float) -> Vec3:
    """Moments of inertia [kg m^2] of a homogeneous solid about its centre, along the shape's axes, which are principal.

    Raises:
        ValueError: the shape is no solid, or a mesh, whose moments do not follow from its size.
    """
    match shape:
        case Box((x, y, z)):
            third = mass / 3
            return third * (y * y + z * z), third * (x * x + z * z), third * (x * x + y * y)
        case Sphere(r):
            moment = 0.4 * mass * r * r
            return moment, moment, moment
        case Cylinder(r, h):
            across = mass * (3 * r * r + 4 * h * h) / 12
            return across, across, 0.5 * mass * r * r
        case Capsule(r, h):
            tube = mass * (2 * h) / (2 * h + 4 / 3 * r)
            caps = mass - tube
            across = tube * (3 * r * r + 4 * h * h) / 12 + caps * (0.4 * r * r + h * h + 0.75 * r * h)
            return across, across, 0.5 * tube * r * r + 0.4 * caps * r * r
        case _:
            raise ValueError(f"a {type(shape).__name__} has no mass of its own")


class Compliance(NamedTuple):
    """How a contact, a limit, dry friction or a tie gives way, where a source says more of it than a time constant.

    `reference` is a time constant [s] and a damping ratio, or, both negative, a stiffness [1/s^2] and a damping [1/s];
    `impedance` goes from its first number to the second over the width [m or rad] of the third, with a midpoint and a
    power, as in MuJoCo's solimp. It acts from a distance of `margin` [m or rad] on. The rest is of contacts: `gap` [m]
    off the margin that contacts are prepared in, `weight` in the mean of two surfaces, `dimensions` of their friction:
    1 for none, 3 along the surface, 4 about its normal too, 6 against rolling too; 0 leaves them to the surface.
    """

    reference: tuple[float, float] | None = None
    impedance: tuple[float, float, float, float, float] | None = None
    margin: float = 0.0
    gap: float = 0.0
    weight: float = 1.0
    dimensions: int = 0


@dataclass(frozen=True, slots=True)
class Surface:
    """How a geom touches. The pair rule is in `anysim.conventions`.

    `softness` is the time constant [s] with which penetration is pushed out (0: the engine's default); `impedance` the
    range (near 0 soft, near 1 rigid) of the constraint as penetration grows, as in MuJoCo's solimp.
    """

    friction: float = 0.8
    torsional_friction: float = 0.005
    rolling_friction: float = 0.0001
    restitution: float = 0.0
    softness: float = 0.0
    impedance: tuple[float, float] = (0.9, 0.95)
    priority: int = 0
    torsional: bool = False  # torsional friction takes part in contacts of this geom
    contact_offset: float | None = None  # [m] from which on contacts are prepared; None leaves it to the engine
    compliance: Compliance | None = field(default=None, metadata=HASHED_IF_GIVEN)


ORDINARY = Surface()
"""A surface of which nothing was said."""


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles in the owner's frame: vertices (V, 3) [m] float64, faces (F, 3) int32; `hash` of source and making."""

    name: str
    vertices: Array = field(repr=False, compare=False)
    faces: Array = field(repr=False, compare=False)
    hash: str = ""


@dataclass(frozen=True, slots=True)
class HeightField:
    """Heights (rows, cols) [m], row 0 at the lowest y, over `size` = full extent (x, y) [m]."""

    name: str
    heights: Array = field(repr=False, compare=False)
    size: tuple[float, float] = (10.0, 10.0)
