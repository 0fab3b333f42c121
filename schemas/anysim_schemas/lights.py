"""Lights, and what is around the things."""

from pydantic import Field

from anysim_schemas.base import Spec
from anysim_schemas.values import ColorValue, FlagValue, NonNegativeValue, Vec3Value


class LightSpec(Spec):
    """A directional light, or a point light where it has a position."""

    direction: Vec3Value = Field(default=(0.0, 0.0, -1.0), description="where it shines to, world axes")
    position: Vec3Value | None = Field(default=None, description="place of a point light [m], world frame")
    color: ColorValue = Field(
        default=(1.0, 1.0, 1.0), description="red, green, blue in [0, 1], or a colour name such as `white`"
    )
    intensity: NonNegativeValue = Field(default=0.8, description="brightness; 1 lights a white surface fully")


class ScenerySpec(Spec):
    """The background, the light from everywhere, and shadows."""

    background: ColorValue | None = Field(
        default=None, description="colour where nothing is; the engine's own sky where not given"
    )
    ambient: ColorValue | None = Field(
        default=None, description="light from everywhere; about a third of white, as the engine has it, where not given"
    )
    shadows: FlagValue | None = Field(
        default=None, description="whether things cast shadows; as the engine's options say where not given"
    )
