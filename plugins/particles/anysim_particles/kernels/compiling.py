"""The decorator of all kernels."""

from functools import partial

from anysim.math.compiled import compiled as in_numba

compiled = partial(in_numba, nogil=True, error_model="numpy")
"""Compile on first use, and keep the machine code; what divides by zero becomes inf or NaN, and so a fault.

Arrays are filled and copied number by number: a slice or an index array takes numba a second to compile, for what it
would say of other shapes. In a loop over many, no row is taken out of an array, and no function gets arrays and returns
a number: numba counts who refers to them there, at 5 ns each, and for a named tuple all of its arrays.
"""
