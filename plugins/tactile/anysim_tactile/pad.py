"""Flat tactile pads: taxels in a grid on a rectangle, and an image of the gel."""

from typing import Annotated

from pydantic import Field

from anysim.task.scene import SceneView
from anysim_tactile.gel import Gel, Grid
from anysim_tactile.surfaces import Length, flat


class TactilePad(Gel):
    """A rectangle about the origin of the sensor's frame, whose z points outwards."""

    def __init__(
        self,
        scene: SceneView,
        *,
        size: Annotated[tuple[Length, Length], Field(description="along x and y [m]")],
        grid: Annotated[Grid, Field(description="taxels: rows along y, columns along x")] = (20, 20),
        image: Annotated[Grid | None, Field(description="its rows and columns; none if not given")] = None,
        **options: object,
    ) -> None:
        super().__init__(scene, flat(size, grid), flat(size, image, pixels=True) if image else None, **options)  # pyright: ignore[reportArgumentType]
