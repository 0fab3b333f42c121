"""Model files of policies of whole envs: what one says of itself, as JSON in its metadata."""

from typing import Annotated

from pydantic import Field

from anysim_schemas.base import Name, Spec

FORMAT = "anysim-policy-1"
METADATA = "anysim"
"""The key of ONNX metadata under which it is, and TorchScript's extra file."""

Count = Annotated[int, Field(ge=1)]


class PolicyFileSpec(Spec):
    """What a model observes and commands, and where it was trained."""

    format: str = Field(description=FORMAT)
    task: str = Field(default="", description="the task that it was trained on")
    world: str = Field(default="", description="the hash of the world that it was trained in")
    engine: str = Field(default="", description="the engine that it was trained on, and its version")
    control_dt: float = Field(default=0.0, ge=0, description="seconds between two actions; 0 if it does not matter")
    observations: dict[Name, Count] = Field(description="its inputs in order: observation groups and their sizes")
    images: dict[str, tuple[Count, Count, Count]] = Field(
        default_factory=dict, description="its further inputs: colour images by name, with height, width and 3"
    )
    actions: Count = Field(description="how many numbers are an action")
    chunk: Count = Field(default=1, description="how many actions it gives for an observation")
