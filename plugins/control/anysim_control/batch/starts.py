"""Random starts of inverse kinematics in the kernels: the draws of `draws.py`, one at a time."""

import math
from functools import partial

import numpy as np

from anysim.math.compiled import compiled as in_numba
from anysim_control.batch.draws import GOLDEN, MIX_1, MIX_2

compiled = partial(in_numba, nogil=True)
"""The decorator of all kernels."""

S11, S27, S30, S31 = np.uint64(11), np.uint64(27), np.uint64(30), np.uint64(31)


@compiled
def uniform(key: np.uint64, counter: int) -> float:
    """Draw number `counter` of the stream `key`, in [0, 1): SplitMix64 with the counter as its state."""
    z = key + (np.uint64(counter) + np.uint64(1)) * GOLDEN
    z = (z ^ (z >> S30)) * MIX_1
    z = (z ^ (z >> S27)) * MIX_2
    z = z ^ (z >> S31)
    return np.float64(z >> S11) * (1.0 / 9007199254740992.0)


@compiled
def start_position(
    attempt: int, k: int, joints: int, lower: float, upper: float, spread: float, seed: float, key: np.uint64
) -> float:
    """Where joint k starts an attempt: at its seed, later anywhere in its limits (in seed +- spread if it has none)."""
    if attempt == 0:
        value = seed
    else:
        draw = uniform(key, (attempt - 1) * joints + k)
        if math.isfinite(lower) and math.isfinite(upper):
            value = lower + (upper - lower) * draw
        else:
            value = seed + spread * (2.0 * draw - 1.0)
    return min(max(value, lower), upper)
