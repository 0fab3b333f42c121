"""Compilation of numerical kernels by numba, for backends and plugins that depend on it; core itself does not."""

from collections.abc import Callable
from typing import Any, Literal


def compiled(
    function: Callable[..., Any], *, nogil: bool = False, error_model: Literal["python", "numpy"] = "python"
) -> Callable[..., Any]:
    """Compile on first call, without fast-math; keep the machine code on disk where there is a place for it.

    numba looks at NUMBA_CACHE_DIR, then beside the function's file, then in the user's cache directory, and raises if
    none can be written to. A read-only installation without a home still has to work: it compiles anew in each process.
    With the error model "numpy" a division by zero gives inf or NaN and no error.
    """
    from numba import njit

    try:
        return njit(cache=True, nogil=nogil, error_model=error_model, fastmath=False)(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        return njit(nogil=nogil, error_model=error_model, fastmath=False)(function)
