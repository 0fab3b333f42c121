"""The compiled arithmetic: one env after the other, serial, without the interpreter lock and without fast-math."""

from functools import partial

from anysim.math.compiled import compiled as in_numba

compiled = partial(in_numba, nogil=True, error_model="numpy")
"""The decorator of all kernels."""
