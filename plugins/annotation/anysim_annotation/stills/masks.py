"""Masks of objects as COCO keeps them: run lengths down the columns, in its own short text, or outlines."""

import numpy as np

from anysim.conventions import Array


def run_lengths(mask: Array) -> list[int]:
    """Lengths of runs of a mask (H, W), column by column; the first is of zeros, and may be 0."""
    flat = mask.ravel(order="F")
    edges = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    bounds = np.concatenate([[0], edges, [flat.size]])
    counts = np.diff(bounds).tolist()
    return [0, *counts] if flat.size and flat[0] else counts


def encoded(counts: list[int]) -> str:
    """Run lengths as text: from the third on differences to the one before last, five bits a character."""
    text: list[str] = []
    for place, count in enumerate(counts):
        x = count - counts[place - 2] if place > 2 else count
        more = True
        while more:
            bits = x & 0x1F
            x >>= 5
            more = x != (-1 if bits & 0x10 else 0)
            text.append(chr((bits | 0x20 if more else bits) + 48))
    return "".join(text)


def outlines(mask: Array) -> list[list[int]] | None:
    """The edges of a mask's pixels as polygons [x, y, x, y, …], one for each part; None where a part has a hole.

    Parts are of pixels that share an edge, and corners are between pixels, so a polygon has the area of its pixels.
    COCO's polygons know no holes.
    """
    ways: dict[tuple[int, int], list[tuple[int, int]]] = {}
    padded = np.pad(mask.astype(bool), 1)
    for along, aside, row, column in ((1, 0, 0, 0), (0, 1, 0, 1), (-1, 0, 1, 1), (0, -1, 1, 0)):
        # an edge, clockwise, where the pixel to its left is not in the mask
        left = np.roll(padded, (along, -aside), axis=(0, 1))
        for v, u in zip(*(axis.tolist() for axis in np.nonzero(padded & ~left)), strict=True):
            ways.setdefault((u - 1 + column, v - 1 + row), []).append((along, aside))
    found: list[list[int]] = []
    while ways:
        start = min(ways)
        x, y = start
        way, line, area = ways[start][0], list[int](), 0
        while True:
            nexts = ways[x, y]
            turn = (-way[1], way[0])  # to the right, into its own part, where two parts touch in a corner
            new = turn if turn in nexts else nexts[0]
            nexts.remove(new)
            if not nexts:
                del ways[x, y]
            if new != way or not line:
                line += [x, y]
            area += x * new[1] - y * new[0]
            x, y, way = x + new[0], y + new[1], new
            if (x, y) == start:
                break
        if area < 0:
            return None
        found.append(line)
    return found
