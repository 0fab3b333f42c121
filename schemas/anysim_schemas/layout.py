"""Layout: where things go. One entry for each object that has a place of its own."""

from typing import ClassVar

from pydantic import Field, model_validator

from anysim_schemas.base import Name, NonNegative, Spec
from anysim_schemas.values import FloatValue, Vec3Value


class PlacementSpec(Spec):
    """A pose: absolute (`position`), or on the top of another object (`on`, with x, y in the world frame).

    The reference point is the object's frame origin; with `on`, the object's lowest point touches the surface.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("position",), ("on", "x", "y"))

    position: Vec3Value | None = Field(default=None, description="place of the frame origin [m], world frame")
    on: Name | None = Field(default=None, description="rests on the top of this object, or on the ground: `terrain`")
    x: FloatValue = Field(default=0.0, description="with `on`: x [m], world frame")
    y: FloatValue = Field(default=0.0, description="with `on`: y [m], world frame")
    roll: FloatValue = Field(default=0.0, description="angle [rad] about the world x axis, applied first")
    pitch: FloatValue = Field(default=0.0, description="angle [rad] about the world y axis, applied second")
    yaw: FloatValue = Field(default=0.0, description="angle [rad] about the world z axis, applied last")
    clearance: NonNegative = Field(default=0.0, description="smallest distance to any other placed object [m]")

    @model_validator(mode="after")
    def _one_way(self) -> "PlacementSpec":
        if (self.position is None) == (self.on is None):
            raise ValueError("give either `position` or `on`")
        return self
