"""The random numbers of the kernels, in arrays: a draw is a function of its stream's key and its number."""

import numpy as np

from anysim.conventions import Array

GOLDEN, MIX_1, MIX_2 = (np.uint64(n) for n in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB))


def uniform_rows(key: Array, counter: Array) -> Array:
    """Draw number `counter` of the stream `key` (uint64), in [0, 1): SplitMix64. The shapes are broadcast."""
    with np.errstate(over="ignore"):  # the arithmetic is modulo 2^64
        z = key.astype(np.uint64) + (counter.astype(np.uint64) + np.uint64(1)) * GOLDEN
        z = (z ^ (z >> np.uint64(30))) * MIX_1
        z = (z ^ (z >> np.uint64(27))) * MIX_2
        z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(11)).astype(np.float64) * (1.0 / 9007199254740992.0)
