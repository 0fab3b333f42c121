"""Tiled ground: pieces of growing difficulty beside each other, as one field of heights with an origin for each."""

from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.world import Tile
from anysim.terrain.generators import HeightPatch, generate
from anysim_schemas.terrain import TerrainSpec, TilesSpec


class Tiling(NamedTuple):
    """One field of heights (rows, cols) [m] over `size` [m], where its middle is, and the tiles in it.

    The world's origin is that of the first tile: row 0, column 0, on its platform.
    """

    heights: Array
    size: tuple[float, float]
    middle: tuple[float, float, float]
    tiles: tuple[Tile, ...]


def difficulty_of(tiles: TilesSpec, row: int) -> float:
    """Of a row of tiles."""
    low, high = tiles.difficulty
    return low if tiles.rows == 1 else low + (high - low) * row / (tiles.rows - 1)


def tile(spec: TerrainSpec, tiles: TilesSpec) -> Tiling:
    """All tiles of a terrain, rows of difficulty along x, columns along y, with flat ground around them.

    Raises:
        ValueError: what does not fit; the message begins with the path of the key below `tiles`, and a colon.
    """
    cell, rows, columns = spec.cell, tiles.rows, len(tiles.columns)
    n, b = round(tiles.size / cell), round(tiles.border / cell)
    heights = np.zeros((columns * n + 1 + 2 * b, rows * n + 1 + 2 * b))
    pieces: dict[tuple[int, int], HeightPatch] = {}
    for k, column in enumerate(tiles.columns):
        for row in range(rows):
            try:
                piece = generate(
                    column.kind,
                    column.parameters(column.kind),
                    difficulty_of(tiles, row),
                    (tiles.size, tiles.size),
                    cell,
                    (spec.seed, row, k),
                )
            except ValueError as error:
                raise ValueError(f"columns.{k}: {error}") from None
            pieces[row, k] = piece
            heights[b + k * n : b + (k + 1) * n + 1, b + row * n : b + (row + 1) * n + 1] = piece.heights
    heights.setflags(write=False)
    first = pieces[0, 0].top
    made = tuple(
        Tile(
            row,
            k,
            tiles.columns[k].kind,
            difficulty_of(tiles, row),
            (row * tiles.size, k * tiles.size, pieces[row, k].top - first),
        )
        for row in range(rows)
        for k in range(columns)
    )
    size = ((rows * n + 2 * b) * cell, (columns * n + 2 * b) * cell)
    middle = ((rows - 1) * tiles.size / 2, (columns - 1) * tiles.size / 2, -first)
    return Tiling(heights, size, middle, made)
