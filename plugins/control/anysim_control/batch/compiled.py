"""The decorator of the kernels: compiled by numba, without the interpreter lock, and kept on disk."""

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile on first call; keep the machine code on disk where there is a place for it.

    numba looks at NUMBA_CACHE_DIR, then beside this file, then in the user's cache directory, and raises if none can be
    written to. A read-only installation without a home still has to work: it compiles anew in each process.
    """
    try:
        return njit(cache=True, nogil=True, fastmath=False)(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        return njit(nogil=True, fastmath=False)(function)
