"""Records: what is written, and by whom."""

from typing import Annotated, Any, Literal

from pydantic import Field

from anysim_schemas.base import Flag, Name, Positive, Spec
from anysim_schemas.plugin import PluginSlot


class RecordSpec(Spec):
    """One directory per trajectory, committed by one rename."""

    writer: str = Field(default="mcap", description="an installed writer, as in `anysim list writers`")
    options: Annotated[dict[str, Any], PluginSlot("writer", "writer")] = Field(
        default_factory=dict, description="options owned by the writer"
    )
    cameras: tuple[Name, ...] = Field(default=(), description="cameras of the world whose images become videos")
    channels: dict[Name, tuple[Literal["depth", "segmentation"], ...]] | None = Field(
        default=None, description="further images of cameras of the world, by camera, recorded without loss"
    )
    streams: dict[Name, dict[str, Any] | None] | None = Field(
        default=None,
        description="further streams and their options, by an installed name, as in `anysim list streams`: annotations "
        "of cameras, language",
    )
    sensors: tuple[Name, ...] | None = Field(
        default=None, description="sensors of the world whose readings are recorded; all of them if not given"
    )
    fps: Positive = Field(default=25.0, description="frames per second of the videos; every n-th control step")
    markers: Flag = Field(
        default=True, description="goals are marked in the videos; of a camera that is observed, task.images says"
    )
    keep: Literal["success", "segments", "all"] = Field(
        default="success",
        description="which trajectories are kept; segments: those too in which a command of `collect` has succeeded",
    )
    film: Literal["auto", "live", "success"] = Field(
        default="auto",
        description="when the videos are drawn; live: in each step; success: when an episode has ended and is kept, "
        "from its recorded states, with the same pixels; auto: success where what is seen follows from the recorded "
        "states and from what was drawn at the reset, else live",
    )
