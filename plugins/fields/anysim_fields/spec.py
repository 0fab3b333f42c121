"""Parameters of fields. What is drawn is drawn for each episode and env."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from anysim_schemas.base import Name, Positive, Reference, Spec, Vec3
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import FloatValue, PositiveValue, Value

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
