"""Masks of objects as COCO keeps them: run lengths down the columns, in its own short text."""

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
