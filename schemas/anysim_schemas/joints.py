"""Joints of articulated objects: where they begin an episode, and how they resist."""

from typing import ClassVar

from pydantic import Field, model_validator

from anysim_schemas.base import Number, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import FloatValue, FractionValue, NonNegativeValue


class ObjectJointSpec(Spec):
    """A joint without a drive; what is left out is as the asset says."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("initial",), ("opened",))

    initial: FloatValue | None = Field(default=None, description="position at the beginning of an episode [rad] or [m]")
    opened: FractionValue | None = Field(
        default=None,
        description="the same as a share of the range: 0 at the limit that is nearer to zero, 1 at the other",
    )
    friction: NonNegativeValue | None = Field(default=None, description="dry friction [N m] or [N]")
    damping: NonNegativeValue | None = Field(default=None, description="[N m s/rad] or [N s/m]")
    limits: tuple[Number, Number] | None = Field(default=None, description="lowest and highest position [rad] or [m]")

    @model_validator(mode="after")
    def _one_beginning(self) -> "ObjectJointSpec":
        if self.initial is not None and self.opened is not None:
            raise KeyFault("give either initial or opened, not both", "opened")
        if self.limits is not None and self.limits[0] >= self.limits[1]:
            raise KeyFault(
                f"the lower limit {self.limits[0]:g} is not below the upper one {self.limits[1]:g}", "limits"
            )
        return self
