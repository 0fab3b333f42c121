"""Cost of many envs, in seconds and memory, measured with a few of them before all are built."""

import sys
import threading
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from math import log2
from pathlib import Path
from typing import NamedTuple

from anysim.errors import EngineError

MANY = 4096
"""From so many envs on a few are built first."""
CROWD = 2000
"""From so many instances in a world on a few are built first."""
_SECONDS, _FEWEST, _MOST = 1.0, 4, 64
_WORTH_A_WORD = 10.0
"""Seconds [s] from which on what is to come is said."""
_GIB = 1 << 30


class CostWarning(UserWarning):
    """Envs that take long to build, or much memory."""


class Cost(NamedTuple):
    """What each env costs, measured with `envs` of them."""

    seconds: float
    bytes: float
    envs: int


def measured(build: Callable[[int], AbstractContextManager[object]]) -> Cost:
    """The cost of an env: that of a few, less what they share.

    Args:
        build: makes that many envs; they are freed when its context ends.
    """
    with build(1):  # imports and caches are paid for once
        pass
    one = _of(build, 1)
    count = max(_FEWEST, min(_MOST, int(_SECONDS / max(one[0], 1e-3))))
    several = _of(build, count)
    seconds, size = (max(all_ - alone, 0.0) / (count - 1) for all_, alone in zip(several, one, strict=True))
    return Cost(seconds, size, count)


def grown(build: Callable[[int], AbstractContextManager[object]], count: int) -> Cost:
    """The cost of each of `count` instances in one world, where the seconds may grow faster than their number."""
    several = CROWD // 8
    size = _of(build, several)[1] / several  # imports and caches are paid for as well
    most = max(2 * several, min(count // 10, CROWD))
    few, more = (_seconds(build, number) for number in (most // 2, most))
    power = min(max(log2(more / few), 1.0), 3.0)
    return Cost(more * (count / most) ** power / count, size, most)


def _seconds(build: Callable[[int], AbstractContextManager[object]], count: int) -> float:
    began = time.perf_counter()
    with build(count):
        return max(time.perf_counter() - began, 1e-3)


def _of(build: Callable[[int], AbstractContextManager[object]], count: int) -> tuple[float, float]:
    """Seconds and bytes that these envs take."""
    before, began = _resident(), time.perf_counter()
    with build(count):
        seconds, grown = time.perf_counter() - began, _resident() - before
    if tracemalloc.is_tracing():
        return seconds, float(grown)
    tracemalloc.start()  # what the process had to spare already does not show in its size
    try:
        with build(count):
            traced = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    return seconds, float(max(grown, traced))


def announce(what: str, count: int, cost: Cost, remedy: str) -> None:
    """Say what so many of `what` cost, where that is worth a word.

    Raises:
        EngineError: they need more memory than there is.
    """
    size, seconds, free = count * cost.bytes, count * cost.seconds, available()
    each = f"{cost.bytes / 1024:.3g} KiB and {1000 * cost.seconds:.2g} ms each, measured with {cost.envs}"
    if free is not None and size > free:
        fit = int(0.8 * free / max(cost.bytes, 1.0))
        raise EngineError(
            f"{count:,} {what} take about {size / _GIB:,.3g} GiB ({each}), and {free / _GIB:.3g} GiB are free; "
            f"about {fit:,} fit: {remedy}"
        )
    if seconds > _WORTH_A_WORD or (free is not None and size > free / 4):
        warnings.warn(
            f"building {count:,} {what} takes about {seconds:,.0f} s and {size / _GIB:,.2g} GiB ({each})",
            CostWarning,
            stacklevel=3,
        )


@contextmanager
def told(what: str) -> Iterator[None]:
    """Say on stderr how long something slow is taking: on a terminal each second, in a pipe a line each minute."""
    done, began = threading.Event(), time.monotonic()

    def tell() -> None:
        live, wait = sys.stderr.isatty(), _WORTH_A_WORD
        while not done.wait(wait):
            words = f"{what}: {time.monotonic() - began:,.0f} s so far"
            sys.stderr.write(f"\r{words}" if live else f"{words}\n")
            sys.stderr.flush()
            wait = 1.0 if live else 60.0
        if live and wait == 1.0:
            sys.stderr.write("\n")

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()


def available() -> int | None:
    """Memory [bytes] that this process may still take; None where that is not known."""
    found: list[int] = []
    with suppress(OSError, ValueError, IndexError):
        lines = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
        found.append(int(lines["MemAvailable"].split()[0]) * 1024)
    with suppress(OSError, ValueError):  # of a container; `max` where it has no limit
        group = Path("/sys/fs/cgroup")
        limit = int((group / "memory.max").read_text())
        found.append(limit - int((group / "memory.current").read_text()))
    return max(min(found), 0) if found else None


def _resident() -> int:
    """Memory [bytes] of this process; 0 where that is not known."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
    return 0
