"""Model files of policies of whole envs: what one says of itself, as JSON in its metadata."""

from typing import Annotated, Any

from pydantic import Field

from anysim_schemas.base import Name, Spec

FORMAT = "anysim-policy-1"
METADATA = "anysim"
"""The key of ONNX metadata under which it is, and TorchScript's extra file."""

Count = Annotated[int, Field(ge=1)]


class PolicyRobotSpec(Spec):
    """A robot as it was in training. Lists have one number for each drive, in the order of `drives`."""

    model: str = Field(description="its name in the catalogue")
    hash: str = Field(description="SHA-256 of its entry there")
    drives: tuple[str, ...] = Field(description="names of its drives")
    home: tuple[float, ...] = Field(description="joint positions it begins at, nominally [rad, m]")
    kp: tuple[float, ...] = Field(description="nominal stiffness [N m/rad, N/m]")
    kd: tuple[float, ...] = Field(description="nominal damping [N m s/rad, N s/m]")
    effort_limit: tuple[float | None, ...] = Field(description="nominal limits [N m, N]; null for none")
    armature: tuple[float, ...] = Field(description="nominal armature [kg m^2, kg]")
    actions: dict[str, Any] = Field(description="the controllers of its channels with their parameters, as in a file")


class PolicyFileSpec(Spec):
    """What a model observes and commands, and where it was trained."""

    format: str = Field(description=FORMAT)
    task: str = Field(default="", description="the task that it was trained on")
    world: str = Field(default="", description="the hash of the world that it was trained in")
    engine: str = Field(default="", description="the engine that it was trained on, and its version")
    control_dt: float = Field(default=0.0, ge=0, description="seconds between two actions; 0 if it does not matter")
    dt: float = Field(default=0.0, ge=0, description="seconds of a physics step in training; 0 where not said")
    actuation: str = Field(default="", description="the drive law in training")
    seed: int | None = Field(default=None, description="of the training")
    steps: int | None = Field(default=None, description="how far the training was, as its learner counts")
    robots: dict[Name, PolicyRobotSpec] = Field(default_factory=dict, description="the robots of the world by name")
    terms: dict[Name, tuple[Any, ...]] = Field(
        default_factory=dict, description="the terms of each group in order, with their parameters, as in a file"
    )
    observations: dict[Name, Count] = Field(description="its inputs in order: observation groups and their sizes")
    images: dict[str, tuple[Count, Count, Count]] = Field(
        default_factory=dict, description="its further inputs: colour images by name, with height, width and 3"
    )
    actions: Count = Field(description="how many numbers are an action")
    chunk: Count = Field(default=1, description="how many actions it gives for an observation")
