"""Cameras: a view point in the world, or one that rides on a link."""

from typing import Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Positive, Spec, Vec3

Channel = Literal["rgb", "depth", "segmentation"]


class CameraSpec(Spec):
    """A pinhole camera. Its frame is optical: x right, y down, z forward.

    Either `from` + `look_at` (a point, or an object whose place at reset is looked at), or `mount` with a pose in the
    frame of that link.
    """

    from_: Vec3 | None = Field(default=None, alias="from", description="eye [m], world frame")
    look_at: Vec3 | str | None = Field(default=None, description="a point [m], or the name of an object")
    mount: str | None = Field(default=None, description="a link or tool to ride on: `panda.panda_hand`")
    position: Vec3 = Field(default=(0.0, 0.0, 0.0), description="with `mount`: [m], in the link's frame")
    roll_pitch_yaw: Vec3 = Field(default=(0.0, 0.0, 0.0), description="with `mount`: [rad], of the optical frame")
    fov: float = Field(default=60.0, gt=1, lt=170, description="vertical field of view [degrees]")
    size: tuple[int, int] = Field(default=(320, 240), description="width, height [pixels]")
    channels: tuple[Channel, ...] = ("rgb",)
    near: Positive = Field(default=0.01, description="[m]")
    far: Positive = Field(default=20.0, description="[m]")

    @model_validator(mode="after")
    def _free_or_mounted(self) -> "CameraSpec":
        free = self.from_ is not None and self.look_at is not None
        if free == (self.mount is not None):
            raise ValueError("give either `from` and `look_at`, or `mount`")
        if min(self.size) < 1:
            raise ValueError(f"size must be positive, got {self.size}")
        return self
