"""Lights."""

from pydantic import Field

from anysim_schemas.base import Positive, Spec, Vec3


class LightSpec(Spec):
    """A directional light, or a point light where it has a position."""

    direction: Vec3 = Field(default=(0.0, 0.0, -1.0), description="where it shines to, world axes")
    position: Vec3 | None = Field(default=None, description="place of a point light [m], world frame")
    color: Vec3 = Field(default=(1.0, 1.0, 1.0), description="red, green, blue in [0, 1]")
    intensity: Positive = Field(default=0.8, description="brightness; 1 lights a white surface fully")
