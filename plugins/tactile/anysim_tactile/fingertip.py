"""Curved tactile fingertips: taxels in a grid on a cap of a sphere or a strip of a cylinder."""

from math import pi
from typing import Annotated

from pydantic import Field

from anysim.task.scene import SceneView
from anysim_tactile.gel import Gel, Grid
from anysim_tactile.surfaces import Length, Surface, cylindrical, spherical

Angle = Annotated[float, Field(gt=0, lt=pi / 2)]


class TactileFingertip(Gel):
    """A cap of a sphere about the origin of the sensor's frame, or a strip of a cylinder about its y; z outwards.

    Taxels yield along their own normals. Rays go along them too; signed distances go along those of what touches, which
    is why `distance` reads a curved skin badly.
    """

    def __init__(
        self,
        scene: SceneView,
        *,
        radius: Annotated[Length, Field(description="[m]")],
        angles: Annotated[tuple[Angle, Angle], Field(description="from the middle: about y, and x of a cap [rad]")] = (
            0.9,
            0.9,
        ),
        length: Annotated[Length | None, Field(description="of a cylinder [m]; a sphere if not given")] = None,
        grid: Annotated[Grid, Field(description="taxels: rows along y, columns along x")] = (20, 20),
        image: Annotated[Grid | None, Field(description="its rows and columns; none if not given")] = None,
        **options: object,
    ) -> None:
        def curved(shape: tuple[int, int], *, pixels: bool = False) -> Surface:
            if length is None:
                return spherical(radius, angles, shape, pixels=pixels)
            return cylindrical(radius, angles[0], length, shape, pixels=pixels)

        super().__init__(scene, curved(grid), curved(image, pixels=True) if image else None, **options)  # pyright: ignore[reportArgumentType]
