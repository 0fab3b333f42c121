"""Procedural textures: patterns made by arithmetic from a seed. No files, the same on every machine.

All of them but `gradient` continue across their edges, so that they can stand side by side.
"""

import numpy as np

from anysim.compile.appearance import Pattern
from anysim.conventions import Array

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


CHECKER = Pattern(_checker, (0.15, 0.15, 0.15), (0.95, 0.95, 0.95))
STRIPES = Pattern(_stripes, (0.20, 0.30, 0.60), (0.95, 0.95, 0.95))
DOTS = Pattern(_dots, (0.95, 0.95, 0.90), (0.80, 0.15, 0.15))
GRADIENT = Pattern(_gradient, (0.95, 0.75, 0.30), (0.25, 0.15, 0.45))
NOISE = Pattern(_noise, (0.25, 0.30, 0.25), (0.85, 0.85, 0.75))
BRICK = Pattern(_brick, (0.80, 0.78, 0.74), (0.62, 0.25, 0.18))
WOOD = Pattern(_wood, (0.45, 0.27, 0.13), (0.76, 0.55, 0.32))
