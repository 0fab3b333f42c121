"""A word about the first use of kernels on a machine: numba compiles them then, and keeps them in its cache."""

import logging
import sys
from typing import Any

WORDS = "compiling the kernels of sensors; this machine keeps them, and the next start needs no time for it"
_log = logging.getLogger("anysim_sensors")


def tell_of_compiling() -> Any:
    """Say so once, when a kernel is compiled and not read from the cache: to the log, and on a terminal."""
    from numba.core import event

    class Teller(event.Listener):
        said = False

        def on_start(self, event: Any) -> None:
            kernel = event.data["dispatcher"].py_func.__module__
            if self.said or not kernel.startswith(("anysim_sensors.", "anysim_tactile.")):
                return
            self.said = True
            _log.info(WORDS)
            if sys.stderr.isatty():
                sys.stderr.write(f"{WORDS}\n")

        def on_end(self, event: Any) -> None:
            pass

    teller = Teller()
    event.register("numba:compile", teller)
    return teller
