"""Parameters of particle matter. What is drawn is drawn for each episode and env."""

from typing import Self

from pydantic import Field, model_validator

from anysim_schemas.base import Color, Integer, Positive, Reference, Spec, Vec3
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import DensityValue, FloatValue, FractionValue, NonNegativeValue, Value

MOST = 50_000
"""Particles of a family."""

Size = tuple[Positive, Positive, Positive]


class MatterSpec(Spec):
    """Where particle matter is when an episode begins: a block that is filled from its bottom."""

    box: Size | None = Field(default=None, description="edges of the block [m]")
    cylinder: tuple[Positive, Positive] | None = Field(
        default=None, description="radius and height [m] of the block, in place of `box`"
    )
    position: Value[Vec3] = Field(default=(0.0, 0.0, 0.0), description="the middle of the block's bottom [m]")
    yaw: FloatValue = Field(default=0.0, description="of the block [rad]")
    at: Reference | None = Field(
        default=None,
        description="a body, or an object: `position` is then in its frame, turned by its heading alone, at the reset",
    )
    fill: FractionValue = Field(default=1.0, description="share of the block's particles that are there")
    density: DensityValue = Field(default=1000.0, description="of the matter [kg/m^3]")
    color: Color | None = Field(default=None, description="of its particles in images")
    substeps: Integer = Field(default=2, gt=0, le=50, description="of the solver in a physics step")
    iterations: Integer = Field(default=3, gt=0, le=100, description="of the solver in a substep")

    @model_validator(mode="after")
    def _one_block(self) -> Self:
        if (self.box is None) == (self.cylinder is None):
            raise KeyFault("the matter needs a block, `box: [x, y, z]` or `cylinder: [radius, height]`", "box")
        return self


class FluidSpec(MatterSpec):
    """A liquid."""

    spacing: Positive = Field(default=0.01, description="of its particles at rest [m]: what it can resolve")
    smoothing: FractionValue = Field(
        default=0.1,
        description="share of the difference of velocities to its neighbours that a particle loses in a substep "
        "(XSPH); no viscosity in Pa s",
    )
    drag: FractionValue = Field(
        default=0.0, description="share of the velocity along a surface that a particle there loses in a substep"
    )


class GrainSpec(MatterSpec):
    """Grains that are dry and hard."""

    density: DensityValue = Field(default=2500.0, description="of the grains themselves [kg/m^3]")
    friction: NonNegativeValue = Field(
        default=0.6,
        description="coefficient between grains; with a body the larger of it and the surface's. Heaps are the steeper "
        "the larger it is, and not as steep as its arctangent",
    )
    settling: Positive = Field(default=0.2, description="speed [m/s] at most with which grains that overlap come apart")
    substeps: Integer = Field(default=6, gt=0, le=50, description="of the solver in a physics step")


class SandSpec(GrainSpec):
    """Round grains."""

    radius: Positive = Field(default=0.004, description="of a grain [m]")


class RiceSpec(GrainSpec):
    """Long grains: three balls or more in a rigid row."""

    density: DensityValue = Field(default=1450.0, description="of the grains themselves [kg/m^3]")
    length: Positive = Field(default=0.007, description="of a grain [m]")
    width: Positive = Field(default=0.0025, description="of a grain [m]")

    @model_validator(mode="after")
    def _long(self) -> Self:
        if not 1.5 * self.width <= self.length <= 6 * self.width:
            raise KeyFault(
                f"a grain is 1.5 to 6 times as long as it is wide; here it is {self.length / self.width:.3g} times",
                "length",
            )
        return self
