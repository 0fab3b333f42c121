"""A texture of crossed lines."""

import numpy as np

from anysim.compile.appearance import Pattern
from anysim.conventions import Array


def _crosses(u: Array, v: Array, seed: int) -> Array:
    """Shares of the second colour: thin lines at a quarter of the image, moved by the seed."""
    shift = np.random.default_rng(seed).random(2)
    near = [np.abs((place * 4 + offset) % 1 - 0.5) < 0.06 for place, offset in zip((u, v), shift, strict=True)]
    return np.logical_or(*near).astype(float)


CROSSES = Pattern(_crosses, (0.9, 0.9, 0.85), (0.15, 0.2, 0.3))
