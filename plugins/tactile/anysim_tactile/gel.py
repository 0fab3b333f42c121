"""Visuotactile sensors: a skin on a gel that a camera looks at from inside."""

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.sensors.base import SensorField
from anysim.task.scene import SceneView
from anysim_tactile.felt import bumps
from anysim_tactile.lights import Light, light as light_named
from anysim_tactile.sensor import Tactile
from anysim_tactile.surfaces import Count, Surface

Grid = tuple[Count, Count]

SOFT = 3e-4
"""[m] over which the gel is smooth beside what presses into it; a guess, of no device."""
LEVELS = (1.0, 0.5, 0.25)


class Gel(Tactile):
    """Taxels in a grid on a surface, and, where its size is given, an image of the gel seen from inside.

    The image has columns to the right as the sensor's x, rows down as its y. Where something presses into the gel its
    slope is that of what presses; the smooth part beside it is guessed.
    """

    def __init__(
        self,
        scene: SceneView,
        taxels: Surface,
        pixels: Surface | None,
        *,
        light: Annotated[str, Field(description="the colours of the image: `gelsight`, or a guess")] = "gelsight",
        **options: object,
    ) -> None:
        super().__init__(scene, taxels, **options)  # pyright: ignore[reportArgumentType]
        self.light = light_named(light)
        self._pixels = None if pixels is None else _Pixels.of(pixels, self._skin.levers(pixels), self.light)
        if self._pixels is not None:
            words = f"rgb, light '{light}'" if self.light.calibrated else f"rgb, light '{light}', uncalibrated"
            self.fields["image"] = SensorField((*self._pixels.surface.shape, 3), "1", words, "uint8")

    def read(self, env_ids: Array) -> Mapping[str, Array]:
        touch = self._touched(env_ids)
        told = self._told(touch)
        if self._pixels is None:
            return told
        seen = self._pixels
        rows, columns = seen.surface.shape
        gap = self._gap(touch.frames, touch.posed, touch.points, seen.surface)
        if touch.short.any():
            close = np.minimum(gap, bumps(touch.points, seen.surface, self._blunt))
            gap = np.where(touch.short[:, None], close, gap)
        moved = np.add.reduce(touch.carried.motion[:, :, None] * seen.levers.T[None], axis=1)
        deep = np.maximum(0.0, moved - gap).reshape(-1, rows, columns)
        deep[touch.carried.deep.max(axis=1) <= 0] = 0.0
        image = np.empty((*deep.shape, 3), dtype=np.uint8)
        self._draw(deep, image)
        return {**told, "image": image}

    def _draw(self, deep: Array, image: Array) -> None:
        from anysim_tactile.kernels.gel import bulge, shade

        assert self._pixels is not None
        height = np.empty_like(deep)
        bulge(deep, self._pixels.weights, height)
        right, down = self._pixels.steps
        shade(height, right, down, self._pixels.background, np.array(self.light.matrix), image)


class _Pixels(NamedTuple):
    """The pixels of the image on the skin.

    Attributes:
        surface: with a taxel for each.
        levers: (pixels, q) see `Skin.levers`.
        steps: [m] from one to the next, to the right and down, in the middle.
        weights: (L, K) of blurs.
        background: (H, W, 3) levels.
    """

    surface: Surface
    levers: Array
    steps: tuple[float, float]
    weights: Array
    background: Array

    @classmethod
    def of(cls, surface: Surface, levers: Array, light: Light) -> "_Pixels":
        """Those of a surface."""
        rows, columns = surface.shape
        grid = surface.points.reshape(rows, columns, 3)
        v, u = max(rows // 2, 1), max(columns // 2, 1)
        right = float(np.linalg.norm(grid[v % rows, u % columns] - grid[v % rows, u - 1])) or surface.pitch
        down = float(np.linalg.norm(grid[v % rows, u % columns] - grid[v - 1, u % columns])) or surface.pitch
        sigmas = [max(SOFT * level / min(right, down), 0.3) for level in LEVELS]
        away = np.arange(int(np.ceil(3 * sigmas[0])) + 1)
        weights = np.array([np.exp(-0.5 * (away / sigma) ** 2) for sigma in sigmas])
        weights /= (2 * weights.sum(axis=1) - weights[:, 0])[:, None]
        return cls(surface, levers, (right, down), weights, light.undisturbed((rows, columns)))
