"""The decorator of all kernels."""

from functools import partial

from anysim.math.compiled import compiled as in_numba

compiled = partial(in_numba, nogil=True, error_model="numpy")
"""Compile on first use, and keep the machine code; what divides by zero becomes inf or NaN, and so a fault."""
