"""Parameters of fields. What is drawn is drawn for each episode and env."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from anysim_schemas.base import Color, Integer, Name, Positive, Reference, Spec, Vec3
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import FlagValue, FloatValue, FractionValue, NonNegativeValue, PositiveValue, Value

MOST = 64
"""Dipoles of a family."""

ORIGIN = (0.0, 0.0, 0.0)


class DipoleSpec(Spec):
    """A magnet, or a ball of iron, on a body."""

    body: Reference | None = Field(
        default=None, description="a body that collides, or an object, that it is fixed to; if not given, the env"
    )
    position: Value[Vec3] = Field(default=ORIGIN, description="in the frame of the body [m]")
    moment: Value[Vec3] = Field(
        default=ORIGIN, description="magnetic moment in the frame of the body [A m^2]: remanence times volume over mu0"
    )
    strength: FloatValue = Field(default=1.0, description="factor on the moment: 0 is off, -1 the other polarity")
    radius: PositiveValue = Field(default=0.01, description="[m] of the ball that is magnetised")
    permeability: Value[Annotated[float, Field(ge=1.0)]] = Field(
        default=1.0, description="relative, of the ball: above 1 the field induces a moment in it, as in iron (1000)"
    )

    @model_validator(mode="after")
    def _magnetic(self) -> Self:
        if self.moment == ORIGIN and self.permeability == 1.0:
            raise KeyFault("a dipole needs a `moment` [A m^2], or a `permeability` above 1", "moment")
        return self


class MagnetSpec(Spec):
    """Dipoles that act on each other, and a uniform field."""

    dipoles: Annotated[dict[Name, DipoleSpec], Field(min_length=1, max_length=MOST)] = Field(
        description="magnets and iron by name"
    )
    field: Value[Vec3] = Field(default=ORIGIN, description="uniform, from elsewhere, world axes [T]")
    range: Positive | None = Field(default=None, description="[m] dipoles farther apart than this do not act")


class SourceSpec(Spec):
    """Where puffs come from, and what carries them."""

    position: Value[Vec3] = Field(default=ORIGIN, description="of the source [m]")
    at: Reference | None = Field(
        default=None, description="a body, or an object, in whose frame the source is, and with which it moves"
    )
    wind: Value[Vec3] = Field(default=ORIGIN, description="everywhere, world axes [m/s]")
    turbulence: NonNegativeValue = Field(
        default=0.3, description="standard deviation of gusts in each direction, as a share of that of the jet or plume"
    )
    diffusion: NonNegativeValue = Field(
        default=0.001,
        description="of the air around [m^2/s]: the variance of a puff grows by twice this times the time",
    )
    puffs: Annotated[Integer, Field(ge=1, le=5000)] = Field(default=250, description="at a time, of which it consists")
    lifetime: Positive = Field(default=4.0, description="of a puff [s]; in the last quarter it fades")
    color: Color | None = Field(default=None, description="in images")


class FireSpec(SourceSpec):
    """A fire with a power."""

    power: PositiveValue = Field(default=5000.0, description="heat that is set free [W]")
    radius: PositiveValue = Field(default=0.08, description="of the burning disc [m]")
    fuel: Literal["wood", "ethanol", "propane", "heptane", "polystyrene"] = Field(
        default="wood", description="that burns: how much soot it makes, and the colour of its flame"
    )
    soot: NonNegativeValue | None = Field(
        default=None, description="kg of soot per kg of what burns; the fuel's if not given"
    )
    flicker: FractionValue = Field(default=0.3, description="share of its height by which the flame swings")
    growth: NonNegativeValue = Field(
        default=0.0, description="[s] until it has its power, towards which it grows with the square of time"
    )
    puffs: Annotated[Integer, Field(ge=1, le=5000)] = Field(default=400, description="at a time, of which it consists")
    lifetime: Positive = Field(default=2.5, description="of a puff [s]; in the last quarter it fades")
    lit: FlagValue = Field(default=True, description="whether it burns when an episode begins")


class DragSpec(Spec):
    """How a body is carried by a flow."""

    area: PositiveValue = Field(description="of its outline [m^2]")
    coefficient: PositiveValue = Field(default=0.47, description="of drag; 0.47 is that of a ball")


class FlowSpec(SourceSpec):
    """Wind, a jet, a plume over a source of heat, and what is seen in them."""

    direction: Value[Vec3] = Field(
        default=(0.0, 0.0, 1.0), description="of the jet, of any length; in the frame of `at`"
    )
    speed: NonNegativeValue = Field(default=0.0, description="of the jet at the source [m/s]")
    heat: NonNegativeValue = Field(default=0.0, description="of the source, which makes a plume [W]")
    radius: PositiveValue = Field(default=0.05, description="of the source [m]")
    look: Literal["smoke", "steam", "dust"] = Field(
        default="smoke", description="what is carried: its colour, extinction and settling where these are not given"
    )
    emission: NonNegativeValue = Field(default=2e-5, description="of what is seen [kg/s]; 0 is clear air")
    extinction: PositiveValue | None = Field(default=None, description="of what is seen [m^2/kg]")
    settling: NonNegativeValue | None = Field(default=None, description="speed at which it sinks through air [m/s]")
    drag: dict[Reference, DragSpec] = Field(
        default_factory=dict, description="bodies, or objects, that it pushes; others do not feel it"
    )
    fluid_density: PositiveValue = Field(default=1.2, description="of what flows [kg/m^3]: air 1.2, water 1000")
