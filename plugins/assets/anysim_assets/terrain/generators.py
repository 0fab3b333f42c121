"""Pieces of generated ground: heights of a rectangle from physical parameters and a difficulty.

Every piece is 0 along its edges, so that pieces fit together, and flat in the middle over its platform, where robots
start. The same generator and parameters give the same heights on every machine: they are rounded to a micrometre.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array

FADE = 0.5
"""[m] over which rough and wavy ground rises from its platform and from its edges."""

Parameters = Mapping[str, Any]


class Lattice(NamedTuple):
    """Where the heights of a piece are: x (rows, cols) and y [m] from its middle, half sizes, and the cell [m]."""

    x: Array
    y: Array
    half: tuple[float, float]
    cell: float

    @property
    def from_edge(self) -> Array:
        """Distance [m] to the nearest edge."""
        return np.minimum(self.half[0] - np.abs(self.x), self.half[1] - np.abs(self.y))

    @property
    def from_platform(self) -> Array:
        """Distance [m] from the middle along the farther axis: 0 in the middle; a platform ends at half its edge."""
        return np.maximum(np.abs(self.x), np.abs(self.y))


class HeightPatch(NamedTuple):
    """Heights (rows, cols) [m], first row at the lowest y; `top` is the height of the platform in the middle."""

    heights: Array
    top: float


def lattice(size: tuple[float, float], cell: float) -> Lattice:
    """The places of the heights of a piece; `size` is a whole number of cells along each axis.

    Raises:
        ValueError: it is not.
    """
    counts = [round(length / cell) for length in size]
    for length, count in zip(size, counts, strict=True):
        if count < 2 or abs(count * cell - length) > 1e-6 * length:
            raise ValueError(f"an extent of {length:g} m is no whole number (2 or more) of cells of {cell:g} m")
    x, y = (np.linspace(-length / 2, length / 2, count + 1) for length, count in zip(size, counts, strict=True))
    grid_x, grid_y = np.meshgrid(x, y)
    return Lattice(grid_x, grid_y, (size[0] / 2, size[1] / 2), cell)


def at(span: float | tuple[float, float], difficulty: float) -> float:
    """A parameter at a difficulty: a pair is what it is at 0 and at 1."""
    low, high = span if isinstance(span, tuple) else (span, span)
    return float(low + (high - low) * difficulty)


def generate(
    kind: str, parameters: Parameters, difficulty: float, size: tuple[float, float], cell: float, seed: tuple[int, ...]
) -> HeightPatch:
    """The heights of one piece of ground.

    Args:
        kind: one of `GENERATORS`.
        parameters: of that kind, see `ReliefSpec.parameters`.
        difficulty: 0 is easy, 1 is hard.
        size: extent along x and y [m]; `cell` is the distance of neighbouring heights [m].
        seed: numbers that everything random is drawn from.

    Raises:
        ValueError: the parameters do not fit the piece or its cells; says which.
    """
    grid = lattice(size, cell)
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    sign = -1.0 if parameters.get("down") else 1.0
    heights = np.round(sign * GENERATORS[kind](grid, parameters, difficulty, rng), 6) + 0.0
    return HeightPatch(heights, float(heights[heights.shape[0] // 2, heights.shape[1] // 2]))


def _room_around(grid: Lattice, platform: float, need: float, what: str) -> float:
    """The width [m] between platform and edges; at least `need`."""
    width = min(grid.half) - platform / 2 - grid.cell
    if width < need - 1e-9:
        raise ValueError(f"{max(width, 0):g} m between the platform and the edge are too little for {what}")
    return width


def _resolved(length: float, grid: Lattice, cells: int, name: str) -> None:
    if length < cells * grid.cell - 1e-9:
        raise ValueError(
            f"`{name}` of {length:g} m needs cells of {length / cells:g} m or less, these are {grid.cell:g}"
        )


def _faded(grid: Lattice, platform: float) -> Array:
    """1 on open ground; falls to 0 at the edges and at the platform."""
    inner = (grid.from_platform - platform / 2) / FADE
    return np.clip(np.minimum(inner, grid.from_edge / FADE), 0.0, 1.0)


def _rough(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """Random bumps, `grain` apart, straight between them."""
    _resolved(p["grain"], grid, 1, "grain")
    cols, rows = (int(np.ceil(2 * half / p["grain"])) + 1 for half in grid.half)
    bumps = rng.uniform(-1.0, 1.0, size=(rows, cols))
    u = (grid.x + grid.half[0]) / (2 * grid.half[0]) * (cols - 1)
    v = (grid.y + grid.half[1]) / (2 * grid.half[1]) * (rows - 1)
    j, i = np.minimum(u.astype(int), cols - 2), np.minimum(v.astype(int), rows - 2)
    t, s = u - j, v - i
    near = (1 - t) * bumps[i, j] + t * bumps[i, j + 1]
    far = (1 - t) * bumps[i + 1, j] + t * bumps[i + 1, j + 1]
    return at(p["amplitude"], difficulty) * ((1 - s) * near + s * far) * _faded(grid, p["platform"])


def _waves(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """Waves along both axes, their crests at random places."""
    _resolved(p["wavelength"], grid, 4, "wavelength")
    phase = rng.uniform(0.0, 2 * np.pi, size=2)
    k = 2 * np.pi / p["wavelength"]
    both = 0.5 * (np.sin(k * grid.x + phase[0]) + np.sin(k * grid.y + phase[1]))
    return at(p["amplitude"], difficulty) * both * _faded(grid, p["platform"])


def _slopes(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """A pyramid whose top is cut off by the platform; with bumps on it where they have a height."""
    width = _room_around(grid, p["platform"], grid.cell, "a slope")
    away = grid.from_platform - p["platform"] / 2  # from the platform outwards
    smooth = at(p["slope"], difficulty) * np.clip(width - np.maximum(away, 0.0), 0.0, width)
    return smooth + _rough(grid, p, difficulty, rng) if at(p["amplitude"], difficulty) else smooth


def _stairs(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """Square rings of equal steps up to the platform. A riser is one cell wide."""
    tread, platform = p["tread"], p["platform"]
    _resolved(tread, grid, 2, "tread")
    steps = int(_room_around(grid, platform, tread, f"a step of {tread:g} m") / tread + 1e-9)
    outwards = np.ceil((grid.from_platform - platform / 2) / tread - 1e-9)
    return at(p["rise"], difficulty) * np.clip(steps - np.maximum(outwards, 0.0), 0.0, steps)


def _stepping_stones(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """Square stones at the height of the platform, in rows that are shifted against each other."""
    stone, gap = at(p["stone"], difficulty), at(p["gap"], difficulty)
    _resolved(stone, grid, 2, "stone")
    _resolved(gap, grid, 2, "gap")
    _room_around(grid, p["platform"], gap, f"a gap of {gap:g} m")
    pitch = stone + gap
    row = np.floor((grid.y + grid.half[1]) / pitch).astype(int)
    shift = rng.uniform(0.0, pitch, size=int(row.max()) + 1)
    along = (grid.x + grid.half[0] + shift[row]) % pitch
    across = (grid.y + grid.half[1]) % pitch
    tops = (along <= stone + 1e-9) & (across <= stone + 1e-9)
    solid = tops | (grid.from_platform <= p["platform"] / 2 + 1e-9) | (grid.from_edge <= grid.cell + 1e-9)
    return np.where(solid, 0.0, -at(p["depth"], difficulty))


def _gaps(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """A moat around the platform; its width is met to within a cell."""
    gap = at(p["gap"], difficulty)
    _resolved(gap, grid, 2, "gap")
    _room_around(grid, p["platform"], gap, f"a gap of {gap:g} m")
    away = grid.from_platform - p["platform"] / 2
    return np.where((away > 1e-9) & (away < gap - 1e-9), -at(p["depth"], difficulty), 0.0)


def _pits(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """The platform is the floor of a pit, and its walls are to be climbed."""
    return np.where(grid.from_platform <= p["platform"] / 2 + 1e-9, -at(p["depth"], difficulty), 0.0)


def _obstacles(grid: Lattice, p: Parameters, difficulty: float, rng: np.random.Generator) -> Array:
    """Blocks of random size and height, none on the platform. The same blocks at every difficulty, only higher."""
    low, high = p["block"]
    _resolved(low, grid, 2, "block")
    heights = np.zeros_like(grid.x)
    free = (grid.from_platform > p["platform"] / 2 + 1e-9) & (grid.from_edge > grid.cell - 1e-9)
    for _ in range(round(p["density"] * 4 * grid.half[0] * grid.half[1])):
        middle = rng.uniform(-1.0, 1.0, size=2) * grid.half
        edges = rng.uniform(low, high, size=2)
        height = at(p["rise"], difficulty) * rng.uniform(0.4, 1.0)
        inside = (np.abs(grid.x - middle[0]) <= edges[0] / 2) & (np.abs(grid.y - middle[1]) <= edges[1] / 2) & free
        heights = np.where(inside, np.maximum(heights, height), heights)
    return heights


GENERATORS: Mapping[str, Callable[[Lattice, Parameters, float, np.random.Generator], Array]] = {
    "rough": _rough, "waves": _waves, "slopes": _slopes, "stairs": _stairs, "stepping_stones": _stepping_stones,
    "gaps": _gaps, "obstacles": _obstacles, "pits": _pits,
}  # fmt: skip
"""By the name of the kind."""
