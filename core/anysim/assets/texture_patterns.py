"""Procedural textures: patterns as images, made by arithmetic from a seed. No files, the same on every machine.

Each pattern is a field of weights in [0, 1] that blends two colours. All of them but `gradient` continue across their
edges, so that they can stand side by side.
"""

from collections.abc import Callable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim.model.appearance import Rgb

_SQUARES, _BANDS, _DOTS = 4, 4, 4
_ROWS, _BRICKS, _MORTAR = 6, 3, 0.08
_RINGS, _GRAIN = 5, 1.6
_OCTAVES = 5


def _checker(u: Array, v: Array, seed: int) -> Array:
    del seed
    return ((np.floor(u * _SQUARES) + np.floor(v * _SQUARES)) % 2).astype(float)


def _stripes(u: Array, v: Array, seed: int) -> Array:
    del v, seed
    return np.floor(u * 2 * _BANDS) % 2


def _dots(u: Array, v: Array, seed: int) -> Array:
    del seed
    x, y = (u * _DOTS) % 1 - 0.5, (v * _DOTS) % 1 - 0.5
    return (x * x + y * y < 0.3**2).astype(float)


def _gradient(u: Array, v: Array, seed: int) -> Array:
    del u, seed
    return v


def _noise(u: Array, v: Array, seed: int) -> Array:
    """Value noise in octaves, each a lattice of random numbers that closes upon itself, smoothly interpolated."""
    generator = np.random.Generator(np.random.Philox(seed))
    total, weight = np.zeros_like(u), 0.0
    for octave in range(_OCTAVES):
        cells = 4 << octave
        lattice = generator.random((cells, cells))
        x, y = u * cells, v * cells
        column, row = np.floor(x).astype(int), np.floor(y).astype(int)
        s, t = (_smooth(part) for part in (x - column, y - row))
        right, below = (column + 1) % cells, (row + 1) % cells
        column, row = column % cells, row % cells
        upper = lattice[row, column] * (1 - s) + lattice[row, right] * s
        lower = lattice[below, column] * (1 - s) + lattice[below, right] * s
        total += 0.5**octave * (upper * (1 - t) + lower * t)
        weight += 0.5**octave
    return np.clip(0.5 + 2.0 * (total / weight - 0.5), 0.0, 1.0)


def _smooth(x: Array) -> Array:
    return x * x * (3 - 2 * x)


def _brick(u: Array, v: Array, seed: int) -> Array:
    """Rows of bricks, every second one shifted by half a brick, each a little darker or lighter than the next."""
    row = np.floor(v * _ROWS).astype(int)
    along = u * _BRICKS + 0.5 * (row % 2)
    column = np.floor(along).astype(int) % _BRICKS
    inside = (v * _ROWS % 1 > _MORTAR * 2) & (along % 1 > _MORTAR)
    shade = np.random.Generator(np.random.Philox(seed)).random((_ROWS, _BRICKS))
    return np.where(inside, 0.75 + 0.25 * shade[row, column], 0.0)


def _wood(u: Array, v: Array, seed: int) -> Array:
    """Year rings, cut along the grain: bands that noise bends."""
    bend = _noise(u, v, seed) - 0.5
    rings = _RINGS * u + _GRAIN * bend
    return np.clip(0.5 + 0.5 * np.sin(2 * np.pi * rings) + 0.25 * (_noise(u, v, seed + 1) - 0.5), 0.0, 1.0)


PATTERNS: Mapping[str, tuple[Callable[[Array, Array, int], Array], Rgb, Rgb]] = {
    "checker": (_checker, (0.15, 0.15, 0.15), (0.95, 0.95, 0.95)),
    "stripes": (_stripes, (0.20, 0.30, 0.60), (0.95, 0.95, 0.95)),
    "dots": (_dots, (0.95, 0.95, 0.90), (0.80, 0.15, 0.15)),
    "gradient": (_gradient, (0.95, 0.75, 0.30), (0.25, 0.15, 0.45)),
    "noise": (_noise, (0.25, 0.30, 0.25), (0.85, 0.85, 0.75)),
    "brick": (_brick, (0.80, 0.78, 0.74), (0.62, 0.25, 0.18)),
    "wood": (_wood, (0.45, 0.27, 0.13), (0.76, 0.55, 0.32)),
}
"""The weights of a pattern, from places (u to the right, v downwards, in [0, 1)) and a seed, and its own colours."""


def draw_pattern(name: str, low: Rgb | None, high: Rgb | None, seed: int, resolution: int) -> Array:
    """The pixels (resolution, resolution, 3) uint8 of a pattern; None for its own colour of weight 0 or 1."""
    field, first, second = PATTERNS[name]
    middle = (np.arange(resolution) + 0.5) / resolution
    u, v = np.meshgrid(middle, middle)
    weight = field(u, v, seed)[..., None]
    colors = np.array(first if low is None else low), np.array(second if high is None else high)
    # the cosine of two machines may differ in its last bit; half a grey level apart is far more than that
    return np.floor(255 * ((1 - weight) * colors[0] + weight * colors[1]) + 0.5 + 1e-9).astype(np.uint8)
