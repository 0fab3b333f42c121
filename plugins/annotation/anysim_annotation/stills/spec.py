"""Spec of a job of still images: the file that `anysim render JOB.yaml` takes."""

from typing import Annotated, Literal

from pydantic import Field

from anysim_schemas.base import Name, Spec

Format = Literal["coco", "kitti"]
Masks = Literal["rle", "polygons"]


class StillsSpec(Spec):
    """A world, how often it is drawn, and what is written. All that is random in it follows from `seed`."""

    source: str = Field(description="an installed task, or a file of a world or a task, from the job's folder")
    overrides: tuple[str, ...] = Field(default=(), description="of the source, as `-o` on the command line")
    engine: str | None = Field(default=None, description="that draws; the source's where not given")
    cameras: tuple[Name, ...] = Field(default=(), description="of the world; all that give colours where none is named")
    images: Annotated[int, Field(ge=1, le=10_000_000)] = Field(
        description="of all cameras together; each reset has one of each"
    )
    seed: Annotated[int, Field(ge=0)] = 0
    formats: tuple[Format, ...] = Field(default=("coco",), description="what is written when all images are there")
    labels: Literal["engine", "geometry"] = Field(
        default="engine", description="where masks and boxes come from: the engine's drawing, or rays"
    )
    masks: Masks = Field(default="rle", description="of COCO: run lengths, or outlines where an object shows no hole")
    least_pixels: Annotated[int, Field(ge=1)] = Field(default=16, description="a thing that shows fewer is left out")
    ignore: tuple[str, ...] = Field(default=(), description="things, or labels, that are no object of interest")
    batch: Annotated[int, Field(ge=1, le=1024)] = Field(
        default=4, description="resets at once; results do not depend on it"
    )
    executor: str | None = Field(default=None, description="whose workers make them; results do not depend on it")
