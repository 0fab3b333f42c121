"""Blocks of particles at a reset: lattices in a box or a cylinder, from the bottom upward."""

import numpy as np

from anysim.conventions import Array
from anysim_particles.spec import MatterSpec


def _axis(length: float, step: float) -> Array:
    """Middles of as many cells as there is room for, about 0; one at least."""
    count = max(1, int(length / step + 1e-9))
    return (np.arange(count) - (count - 1) / 2) * step


def _within(spec: MatterSpec, points: Array, reach: float) -> Array:
    """Which points (n, 3) are so far inside of a cylinder; in a box all are."""
    if spec.cylinder is None:
        return np.ones(len(points), dtype=bool)
    return np.hypot(points[:, 0], points[:, 1]) <= max(spec.cylinder[0] - reach, 0.0) + 1e-9


def _size(spec: MatterSpec) -> tuple[float, float, float]:
    if spec.box is not None:
        return spec.box
    assert spec.cylinder is not None
    radius, height = spec.cylinder
    return 2 * radius, 2 * radius, height


def lattice(spec: MatterSpec, step: float) -> Array:
    """A cubic lattice (P, 3) [m] about the middle of the block's bottom, layer by layer."""
    x, y, z = (_axis(length, step) for length in _size(spec))
    z = z - z[0] + step / 2
    points = np.stack(np.meshgrid(z, y, x, indexing="ij"), axis=-1).reshape(-1, 3)[:, ::-1]
    return np.ascontiguousarray(points[_within(spec, points, step / 2)])


def rows(spec: MatterSpec, long: float, wide: float) -> tuple[Array, Array]:
    """Middles (P, 3) [m] and directions (P, 3) of long things, side by side, each layer across the one below."""
    sx, sy, sz = _size(spec)
    middles, ways = list[Array](), list[Array]()
    heights = _axis(sz, wide)
    for layer, height in enumerate(heights - heights[0] + wide / 2):
        along = layer % 2 == 0
        x, y = _axis(sx, long if along else wide), _axis(sy, wide if along else long)
        flat = np.stack(np.meshgrid(y, x, indexing="ij"), axis=-1).reshape(-1, 2)[:, ::-1]
        points = np.concatenate([flat, np.full((len(flat), 1), height)], axis=1)
        points = points[_within(spec, points, long / 2)]
        middles.append(points)
        ways.append(np.tile([1.0, 0.0, 0.0] if along else [0.0, 1.0, 0.0], (len(points), 1)))
    return np.concatenate(middles), np.concatenate(ways)


def scattered(spec: MatterSpec, radius: float, count: int, numbers: np.random.Generator) -> Array:
    """As many balls (P, 3) [m] at random places of the block, none in another, the lowest first.

    Where no room is found for the last ones, they stand over the block.
    """
    from anysim_particles.kernels.packing import pack

    x, y, z = _size(spec)
    high = np.array([max(x / 2 - radius, 0.0), max(y / 2 - radius, 0.0), max(z - radius, radius)])
    low = np.array([-high[0], -high[1], radius])  # where a ball is wider than the block, they stand in a column
    packed, done, top = np.zeros((count, 3)), 0, high.copy()
    while done < count:
        tried = numbers.uniform(low, top, (20 * count, 3))
        tried = np.ascontiguousarray(tried[_within(spec, tried, radius)])
        done = pack(tried, low, top, 2 * radius, packed, done)
        top[2] += 2 * radius
    return packed[np.argsort(packed[:, 2], kind="stable")]
