"""Relations between things that are placed."""

from typing import Any, ClassVar, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Name, NonNegative, Number, Spec
from anysim_schemas.errors import KeyFault
from anysim_schemas.regions import Vec2


class Relation(Spec):
    """To another object. A bare string is its name."""

    of: Name = Field(description="the other object, or a robot")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The other object."""
        return {"of": text}


class Apart(Relation):
    """A relation at a distance."""

    distance: tuple[NonNegative, NonNegative] = Field(
        default=(0.0, 0.3), description="least and greatest distance between the two [m]"
    )

    @model_validator(mode="after")
    def _ordered(self) -> "Apart":
        low, high = self.distance
        if low > high:
            raise KeyFault(f"the least distance {low:g} m is above the greatest {high:g} m", "distance")
        return self


class NearSpec(Apart):
    """Near another object: between the nearest points of both, as they are shaped. A bare string is its name."""


class SideSpec(Apart):
    """On one side of another object. The distance is between the two along that side. A bare string is its name.

    Seen along x: in front is +x, left is +y, behind is -x, right is -y, of the world or of the other object's frame.
    """

    axes: Literal["world", "own"] = Field(
        default="world", description="whose axes say what left is: the world's, or those of the other object"
    )
    lateral: NonNegative | None = Field(
        default=None,
        description="how far the centre may be off sideways [m]; half the other object's width where not given",
    )


class FacingSpec(Spec):
    """Turned so that its x axis points at an object or a point; `yaw` is added. A bare string is an object's name."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("of",), ("point",))

    of: Name | None = Field(default=None, description="an object or a robot")
    point: Vec2 | None = Field(default=None, description="x, y [m], world frame")

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The object that is faced."""
        return {"of": text}

    @model_validator(mode="after")
    def _one_way(self) -> "FacingSpec":
        if (self.of is None) == (self.point is None):
            raise ValueError("give either `of` or `point`")
        return self


class AlignedSpec(Relation):
    """Turned as another object is; `yaw` is added. With `along`, in line with it too. A bare string is its name."""

    along: Literal["x", "y"] | None = Field(
        default=None, description="on the line through the other object's origin along this one of its axes"
    )
    offset: Number = Field(default=0.0, description="with `along`: distance from that line [m], to its left")


SIDES = ("left_of", "right_of", "in_front_of", "behind")
