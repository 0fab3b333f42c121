"""Parameters of soft matter. What is drawn is drawn for each episode and env."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from anysim_schemas.base import Color, Integer, Name, Positive, Reference, Spec, Vec3
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import DensityValue, FloatValue, NonNegativeValue, PositiveValue, Value

MOST = 20_000
"""Points of a family."""

Side = Annotated[str, Field(pattern=r"^([+-][xyz]){1,3}$")]
"""Where it ends: `-x` is the face of smallest x, `-x+y` the edge that it shares with `+y`."""
Edge = Annotated[str, Field(pattern=r"^([+-][xy]){1,2}$")]
"""Where a sheet ends: `-x` is an edge, `-x+y` a corner."""
Count = Annotated[Integer, Field(ge=1, le=64)]
Points = Annotated[Integer, Field(ge=2, le=200)]
Heavier = Annotated[float, Field(ge=1.0, le=4.0)]


class SoftSpec(Spec):
    """Where soft matter is when an episode begins, and how it is moved."""

    position: Value[Vec3] = Field(default=(0.0, 0.0, 0.0), description="of its frame [m]")
    yaw: FloatValue = Field(default=0.0, description="of its frame [rad]")
    at: Reference | None = Field(
        default=None,
        description="a body, or an object: `position` is then in its frame, turned by its heading alone, at the reset",
    )
    drag: NonNegativeValue = Field(
        default=0.0, description="rate at which it loses velocity to air at rest [1/s]: exp(-drag t)"
    )
    friction: NonNegativeValue = Field(default=0.6, description="coefficient; with a body the larger of the two acts")
    held: dict[Reference, Heavier] = Field(
        default_factory=dict,
        description="free bodies that something else in the engine will hold, and how many times heavier, 1 to 4, they "
        "are for this matter: a gripped body yields less than its mass says",
    )
    color: Color | None = Field(default=None, description="of its surface in images")
    substeps: Integer = Field(default=1, gt=0, le=50, description="of the solver in a physics step")


class DeformableSpec(SoftSpec):
    """A block of an elastic solid, which is stress-free as the box."""

    box: tuple[Positive, Positive, Positive] = Field(description="edges [m]; its frame is at the middle of its bottom")
    density: DensityValue = Field(default=1000.0, description="of the matter [kg/m^3]")
    young: PositiveValue = Field(default=1e5, description="Young's modulus [Pa]")
    poisson: Value[Annotated[float, Field(ge=0.0, le=0.45)]] = Field(default=0.3, description="Poisson's ratio")
    damping: NonNegativeValue = Field(
        default=0.01,
        description="[s] Rayleigh's: what moves it apart is resisted by the stiffness times this times the rate",
    )
    cells: tuple[Count, Count, Count] = Field(
        default=(1, 1, 1), description="quadratic elements along each edge: what bends needs two or more along it"
    )
    points: tuple[Points, Points, Points] = Field(
        default=(5, 5, 5), description="of a lattice along each edge, of which the outer ones meet bodies and are drawn"
    )
    fixed: tuple[Side, ...] = Field(default=(), description="faces, edges or corners that stay where they begin")

    attached: dict[Side, Reference] = Field(
        default_factory=dict, description="faces, edges or corners that a body holds where they are at the reset"
    )

    @model_validator(mode="after")
    def _sizes(self) -> Self:
        nodes = 1
        for cells in self.cells:
            nodes *= 2 * cells + 1
        if nodes > MOST // 4:
            raise KeyFault(f"{nodes:,} nodes; {MOST // 4:,} at most are possible", "cells")
        if max(max(self.box) / min(self.box), 1.0) > 1e3:
            raise KeyFault("an edge is more than 1000 times as long as another", "box")
        return self


class PadSpec(Spec):
    """A hand that cloth or a rope sticks to while it is closed, or that pinches cloth; its links do not touch it."""

    grip: Literal["sticky", "pinch"] = Field(
        default="sticky",
        description="whether the nearest points stick to it, or two pads on its fingers press on cloth, which friction "
        "holds",
    )
    tool: Reference = Field(description="the frame at which it sticks, such as `panda.tool`, or in which pads meet")
    joint: Reference = Field(description="the joint that closes the hand, such as `panda.panda_finger_joint1`")
    closed: float = Field(default=0.01, description="position of that joint [m, rad] at or below which it is closed")
    reach: Positive = Field(default=0.02, description="how far from the frame it sticks when the hand closes [m]")
    points: Annotated[Integer, Field(ge=1, le=32)] = Field(default=5, description="that stick at most, the nearest")
    force: Positive = Field(
        default=20.0,
        description="[N] beyond which it comes off, until the hand has opened; of a pinch with which each pad presses",
    )
    size: tuple[Positive, Positive, Positive] = Field(
        default=(0.02, 0.016, 0.018), description="of a pinch, edges of each pad along the axes of `tool` [m]"
    )


class RopeSpec(SoftSpec):
    """A rope that stretches by next to nothing and does not resist bending."""

    path: Annotated[tuple[Vec3, ...], Field(min_length=2)] = Field(
        description="corners [m] of the line along which it lies when an episode begins, in its frame: it is as long"
    )
    density: DensityValue = Field(default=1000.0, description="of the matter [kg/m^3]")
    radius: Positive = Field(default=0.005, description="[m]")
    segments: Annotated[Integer, Field(ge=2, le=400)] = Field(default=40, description="of equal length, straight each")
    fixed: tuple[Literal["start", "end"], ...] = Field(default=(), description="ends that stay where they begin")
    attached: dict[Literal["start", "end"], Reference] = Field(
        default_factory=dict, description="ends that a body holds where they are at the reset"
    )
    pads: dict[Name, PadSpec] | None = Field(default=None, description="hands that hold it while they are closed")
    substeps: Integer = Field(
        default=4, gt=0, le=50, description="of the solver in a physics step: the more, the more it can carry"
    )

    @model_validator(mode="after")
    def _long(self) -> Self:
        corners = zip(self.path, self.path[1:], strict=False)
        if min(sum((a - b) ** 2 for a, b in zip(p, q, strict=True)) for p, q in corners) < 1e-12:
            raise KeyFault("two corners that follow each other are at one place", "path")
        if pinching := [name for name, pad in (self.pads or {}).items() if pad.grip == "pinch"]:
            raise KeyFault(
                f"friction holds garments alone, a rope sticks to the pad '{pinching[0]}'; leave `grip` out", "pads"
            )
        return self


class FemClothSpec(SoftSpec):
    """A sheet of an elastic material, flat and stress-free in the plane of its frame."""

    size: tuple[Positive, Positive] = Field(description="edges [m]; its frame is at its middle")
    thickness: PositiveValue = Field(default=0.001, description="[m]")
    young: PositiveValue = Field(default=1e5, description="Young's modulus [Pa] in the plane")
    poisson: Value[Annotated[float, Field(ge=0.0, le=0.45)]] = Field(default=0.3, description="Poisson's ratio")
    bending: NonNegativeValue | None = Field(
        default=None, description="flexural rigidity of a strip by its width [N m]; young thickness^3 / 12 if not given"
    )
    damping: NonNegativeValue = Field(
        default=0.01,
        description="[s] Rayleigh's: what moves it apart is resisted by the stiffness times this times the rate",
    )
    density: DensityValue = Field(default=300.0, description="of the matter [kg/m^3]")
    points: tuple[Points, Points] = Field(default=(15, 15), description="along each edge")
    radius: Positive = Field(default=0.003, description="[m] from its middle at which contacts act")
    fixed: tuple[Edge, ...] = Field(default=(), description="edges or corners that stay where they begin")
    attached: dict[Edge, Reference] = Field(
        default_factory=dict, description="edges or corners that a body holds where they are at the reset"
    )


class InflatableSpec(SoftSpec):
    """A thin elastic ball with gas in it."""

    radius: Positive = Field(default=0.15, description="of the ball where nothing stretches it [m]")
    pressure: NonNegativeValue = Field(
        default=1000.0, description="of the gas above that of the air, when an episode begins [Pa]"
    )
    thickness: PositiveValue = Field(default=0.001, description="of the skin [m]")
    young: PositiveValue = Field(default=1e6, description="Young's modulus of the skin [Pa]; rubber has 1e6")
    poisson: Value[Annotated[float, Field(ge=0.0, le=0.5)]] = Field(default=0.45, description="Poisson's ratio")
    damping: NonNegativeValue = Field(
        default=0.01,
        description="[s] Rayleigh's: what moves it apart is resisted by the stiffness times this times the rate",
    )
    density: DensityValue = Field(default=1000.0, description="of the skin [kg/m^3]")
    subdivisions: Annotated[Integer, Field(ge=1, le=3)] = Field(
        default=2, description="of the 20 triangles of an icosahedron: 42, 162 or 642 points"
    )
    skin: Positive = Field(default=0.003, description="[m] from its surface at which contacts act")
    substeps: Integer = Field(default=2, gt=0, le=50, description="of the solver in a physics step")
