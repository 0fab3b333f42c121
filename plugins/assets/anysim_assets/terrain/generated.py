"""Generated ground of a spec: one piece, or tiles of them beside each other."""

import numpy as np

from anysim.compile.terrain import GeneratedGround
from anysim.errors import Issues
from anysim.model.world import Tile
from anysim_assets.terrain.generators import HeightPatch, generate
from anysim_schemas.terrain import TerrainSpec, TilesSpec

DIFFICULTY = 0.5
"""Of generated ground that says none."""


def generated(spec: TerrainSpec, issues: Issues) -> GeneratedGround | None:
    """One piece of a kind, or tiles; None with the reasons in `issues`, whose path is the terrain's."""
    return _piece(spec, issues) if spec.kind != "tiles" else _tiles(spec, spec.tiling, issues)


def _piece(spec: TerrainSpec, issues: Issues) -> GeneratedGround | None:
    difficulty = DIFFICULTY if spec.difficulty is None else spec.difficulty
    try:
        piece = generate(spec.kind, spec.parameters(spec.kind), difficulty, spec.size, spec.cell, (spec.seed,))
    except ValueError as error:
        issues.add("", str(error))
        return None
    return GeneratedGround(piece.heights, spec.size, (0.0, 0.0, -piece.top))


def difficulty_of(tiles: TilesSpec, row: int) -> float:
    """Of a row of tiles."""
    low, high = tiles.difficulty
    return low if tiles.rows == 1 else low + (high - low) * row / (tiles.rows - 1)


def _tiles(spec: TerrainSpec, tiles: TilesSpec, issues: Issues) -> GeneratedGround | None:
    """All tiles of a terrain, rows of difficulty along x, columns along y, with flat ground around them."""
    cell, rows, columns = spec.cell, tiles.rows, len(tiles.columns)
    n, b = round(tiles.size / cell), round(tiles.border / cell)
    heights = np.zeros((columns * n + 1 + 2 * b, rows * n + 1 + 2 * b))
    pieces: dict[tuple[int, int], HeightPatch] = {}
    for k, column in enumerate(tiles.columns):
        parameters, size = column.parameters(column.kind), (tiles.size, tiles.size)
        for row in range(rows):
            try:
                piece = generate(column.kind, parameters, difficulty_of(tiles, row), size, cell, (spec.seed, row, k))
            except ValueError as error:
                issues.add(f"tiles.columns.{k}", str(error))
                return None
            pieces[row, k] = piece
            heights[b + k * n : b + (k + 1) * n + 1, b + row * n : b + (row + 1) * n + 1] = piece.heights
    first = pieces[0, 0].top
    made = tuple(
        Tile(row, k, tiles.columns[k].kind, difficulty_of(tiles, row), (row * tiles.size, k * tiles.size, top - first))
        for (row, k), (_, top) in sorted(pieces.items())
    )
    extent = ((rows * n + 2 * b) * cell, (columns * n + 2 * b) * cell)
    middle = ((rows - 1) * tiles.size / 2, (columns - 1) * tiles.size / 2, -first)
    return GeneratedGround(heights, extent, middle, made)
