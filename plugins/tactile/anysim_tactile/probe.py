"""Tactile probes: single taxels at points of a body."""

from typing import Annotated

from pydantic import Field

from anysim.task.scene import SceneView
from anysim_tactile.sensor import Tactile, Vector
from anysim_tactile.surfaces import Length, scattered


class TactileProbe(Tactile):
    """Taxels at points of a body, each with its normal and an area of skin that it stands for."""

    def __init__(
        self,
        scene: SceneView,
        *,
        points: Annotated[list[Vector], Field(min_length=1, description="of the taxels, in the sensor's frame [m]")],
        normals: Annotated[
            list[Vector] | None, Field(description="outward; one for all, or one for each; z if not given")
        ] = None,
        area: Annotated[Length, Field(description="of each taxel [m^2]")] = 1e-4,
        **options: object,
    ) -> None:
        super().__init__(scene, scattered(points, normals or [(0.0, 0.0, 1.0)], area), **options)  # pyright: ignore[reportArgumentType]
