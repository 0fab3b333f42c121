"""Compilation of numerical kernels by numba, for backends and plugins that depend on it; core itself does not."""

import logging
import sys
from collections.abc import Callable
from functools import cache
from typing import Any, Literal

FIRST_USE = "compiling numerical kernels; this machine keeps them, and the next start needs no time for it"
_log = logging.getLogger("anysim")


def compiled(
    function: Callable[..., Any], *, nogil: bool = False, error_model: Literal["python", "numpy"] = "python"
) -> Callable[..., Any]:
    """Compile on first call, without fast-math; keep the machine code on disk where there is a place for it.

    numba looks at NUMBA_CACHE_DIR, then beside the function's file, then in the user's cache directory, and raises if
    none can be written to. A read-only installation without a home still has to work: it compiles anew in each process.
    With the error model "numpy" a division by zero gives inf or NaN and no error.
    """
    from numba import njit

    tell_of_compiling()
    try:
        return njit(cache=True, nogil=nogil, error_model=error_model, fastmath=False)(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        return njit(nogil=nogil, error_model=error_model, fastmath=False)(function)


@cache
def tell_of_compiling() -> Any:
    """Say once that kernels are compiled, when they are and not read from the cache: to the log, and on a terminal."""
    from numba.core import event

    class Teller(event.Listener):
        said = False

        def on_start(self, event: Any) -> None:
            if self.said or not event.data["dispatcher"].py_func.__module__.startswith("anysim"):
                return
            self.said = True
            _log.info(FIRST_USE)
            if sys.stderr.isatty():
                sys.stderr.write(f"{FIRST_USE}\n")

        def on_end(self, event: Any) -> None:
            pass

    teller = Teller()
    event.register("numba:compile", teller)
    return teller
