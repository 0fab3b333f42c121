"""Options of SAPIEN that mean nothing to another engine."""

from typing import ClassVar, Literal

from pydantic import Field

from anysim.engine.options import EngineOptions
from anysim.model.world import Scenery

OWN_SCENERY = Scenery((0.867, 0.902, 0.941), (0.35, 0.35, 0.35), False)
"""What is drawn where the World says nothing."""


class SapienOptions(EngineOptions):
    """Options of the engine `sapien`, as in `engine: {name: sapien, options: {position_iterations: 30}}`."""

    shaping: ClassVar[tuple[str, ...]] = (
        "position_iterations",
        "velocity_iterations",
        "contact_offset",
        "bounce_threshold",
        "depenetration_velocity",
        "rebase_steps",
    )

    position_iterations: int = Field(
        default=30,
        ge=1,
        le=255,
        description="iterations of the constraint solver; with 15 a blocked drive is up to 6 % weaker than it says",
    )
    velocity_iterations: int = Field(default=1, ge=0, le=255, description="further iterations on velocities alone")
    contact_offset: float = Field(
        default=0.005, gt=0, description="distance at which contacts are prepared [m]; forces act from touch on"
    )
    bounce_threshold: float = Field(
        default=0.02, ge=0, description="approach speed below which contacts do not bounce [m/s]"
    )
    depenetration_velocity: float = Field(
        default=5.0, gt=0, description="highest speed at which bodies that overlap are pushed apart [m/s]"
    )
    rebase_steps: int = Field(
        default=5000,
        ge=1,
        description="physics steps after which an env's scene is built anew from its motion; this bounds what an exact "
        "snapshot holds and how long it takes to restore",
    )
    vulkan_icd: str = Field(
        default="auto",
        description="Vulkan driver that draws: auto (what the environment says, a system driver, else Chromium's "
        "software driver), none, or the path of a driver's JSON file",
    )
    shader: Literal["auto", "lit", "trivial", "default"] = Field(
        default="auto",
        description="lit: lights without shadows, fast in software; trivial: flat colours, whatever the lights; "
        "default: SAPIEN's own materials, half a minute to the first image without a graphics card; "
        "auto: lit in software, else default",
    )
