"""Cameras: a view point in the world, or one that rides on a link."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, Strict, model_validator

from anysim_schemas.base import Degrees, Positive, Spec, Vec3
from anysim_schemas.errors import KeyFault
from anysim_schemas.values import NonNegativeValue, PositiveValue, Value, Vec3Value

Channel = Literal["rgb", "depth", "segmentation"]
Pixels = Annotated[int, Strict(), Field(gt=0)]


class CameraSpec(Spec):
    """A pinhole camera. Its frame is optical: x right, y down, z forward.

    Either `from` + `look_at` (a point, or an object whose place at reset is looked at), or `mount` with a pose in the
    frame of that link.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("from", "look_at", "look_at_offset"),
        ("mount", "position", "roll_pitch_yaw"),
    )

    from_: Vec3Value | None = Field(default=None, alias="from", description="eye [m], world frame")
    look_at: Vec3 | str | None = Field(default=None, description="a point [m], or the name of an object")
    look_at_offset: Vec3Value = Field(
        default=(0.0, 0.0, 0.0), description="added to the point that is looked at [m], world axes"
    )
    mount: str | None = Field(default=None, description="a link or tool to ride on: `panda.panda_hand`")
    position: Vec3Value = Field(default=(0.0, 0.0, 0.0), description="with `mount`: place in the link's frame [m]")
    roll_pitch_yaw: Vec3Value = Field(default=(0.0, 0.0, 0.0), description="with `mount`: of the optical frame [rad]")
    fov: Value[Degrees] = Field(default=60.0, description="vertical field of view [degrees]")
    size: tuple[Pixels, Pixels] = Field(default=(320, 240), description="width, height [pixels]")
    channels: tuple[Channel, ...] = Field(default=("rgb",), description="the images it takes")
    exposure: PositiveValue = Field(default=1.0, description="factor of the brightness of its colour images")
    noise: NonNegativeValue = Field(
        default=0.0, description="standard deviation of the noise of its colour images, drawn for each image; of white"
    )
    near: Positive = Field(default=0.01, description="distance of the near clipping plane [m]")
    far: Positive = Field(default=20.0, description="distance of the far clipping plane [m]")

    @model_validator(mode="after")
    def _free_or_mounted(self) -> "CameraSpec":
        view = (self.from_ is not None, self.look_at is not None)
        if (self.mount is None and not all(view)) or (self.mount is not None and any(view)):
            raise ValueError("give either `from` and `look_at`, or `mount`")
        if self.near >= self.far:
            raise KeyFault(f"near ({self.near:g} m) must be less than far ({self.far:g} m)", "near")
        return self
