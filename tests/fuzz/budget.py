"""Time and memory that one hostile input may take, and the count of what inputs came to.

An input that is accepted, or refused with an `AnysimError`, is fine. Any other exception, more time or more memory is a
fault, which names the input.
"""

import faulthandler
import gc
import resource
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from anysim.errors import AnysimError

SECONDS, BYTES = 5.0, 1 << 30
"""What one input may take [s], [bytes]."""
_GUARD = 4
"""Beyond this many times the memory nothing is given out: `MemoryError`. Below, what was used is measured."""
_STUCK = 12
"""After this many times the seconds a call that no signal interrupts ends the process, with its stack."""


class OverBudgetError(BaseException):
    """An input took too long, or too much; no `except Exception` of the code under test catches it."""


@contextmanager
def within(seconds: float = SECONDS, size: int = BYTES) -> Iterator[None]:
    """Run the body in this process within a time [s] and a growth of memory [bytes].

    Raises:
        OverBudgetError: it took longer, and was interrupted, or its peak of resident memory grew by more; also where
            the body made an error of its own of the interrupt, as what tells of a plugin's faults does.
    """

    def late(*_: object) -> None:
        raise OverBudgetError(f"took more than {seconds:g} s")

    before, limits = _status("VmRSS"), resource.getrlimit(resource.RLIMIT_AS)
    _forget_peak()
    handler = signal.signal(signal.SIGALRM, late)
    began = time.monotonic()
    faulthandler.dump_traceback_later(_STUCK * seconds, exit=True, file=sys.__stderr__)
    resource.setrlimit(resource.RLIMIT_AS, (_status("VmSize") + _GUARD * size, limits[1]))
    signal.setitimer(signal.ITIMER_REAL, seconds)
    given = True
    try:
        yield
    except MemoryError:
        given = False  # what was refused was not taken, however much the system has moved meanwhile
        raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, limits)
        faulthandler.cancel_dump_traceback_later()
        _spent(time.monotonic() - began, seconds, (_status("VmHWM") - before) * given, size)


def _spent(took: float, seconds: float, grown: int, size: int) -> None:
    if took > seconds:
        raise OverBudgetError(f"took more than {seconds:g} s: {took:.2f} s")
    if grown > size:
        raise OverBudgetError(f"took {grown / (1 << 20):.0f} MiB")


class Tally:
    """Counts inputs of a kind, and what they came to.

    Attributes:
        inputs: how many were tried; `accepted` and `refused` add up to it where there is no fault.
        words: how often each kind of error refused one.
        faults: a sentence for each input that was neither accepted nor refused, or went over its budget.
    """

    def __init__(self, name: str, seconds: float = SECONDS, size: int = BYTES) -> None:
        self.name, self.seconds, self.size = name, seconds, size
        self.inputs = self.accepted = self.refused = 0
        self.words: Counter[str] = Counter()
        self.faults: list[str] = []
        self.slowest = (0.0, "")

    def run(self, label: str, call: Callable[[], object]) -> AnysimError | None:
        """Try one input; returns what refused it, if anything did."""
        self.inputs += 1
        began = time.monotonic()
        try:
            with within(self.seconds, self.size):
                call()
        except AnysimError as error:
            self.refused += 1
            self.words[type(error).__name__] += 1
            if not str(error).strip():
                self.faults.append(f"{label}: refused without a word ({type(error).__name__})")
            return error
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - that is what is looked for
            self.fault(label, error)
        else:
            self.accepted += 1
        finally:
            self.slowest = max(self.slowest, (time.monotonic() - began, label))
        return None

    def fault(self, label: str, error: BaseException | str) -> None:
        """Note a fault, with the innermost lines of code."""
        if isinstance(error, str):
            self.faults.append(f"{label}: {error}")
            return
        frames = traceback.extract_tb(error.__traceback__)[-3:]
        where = " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in reversed(frames))
        self.faults.append(f"{label}: {type(error).__name__}: {str(error)[:200]} ({where})")

    @property
    def report(self) -> str:
        """`2000 forged snapshots: 312 accepted, 1688 refused (SnapshotError 1688), 0 faults; slowest 0.12 s`."""
        kinds = ", ".join(f"{name} {count}" for name, count in self.words.most_common())
        return (
            f"{self.inputs} {self.name}: {self.accepted} accepted, {self.refused} refused ({kinds}), "
            f"{len(self.faults)} faults; slowest {self.slowest[0]:.2f} s ({self.slowest[1][:80]})"
        )

    def passed(self, count: int) -> None:
        """Print the counts, and fail where there is a fault or other than `count` inputs were tried."""
        print(self.report)
        assert not self.faults, "\n".join([self.report, *self.faults[:40]])
        assert self.inputs == count, f"{self.inputs} {self.name} were tried, not {count}"


def _status(key: str) -> int:
    """A size of this process [bytes], from Linux."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(f"{key}:"):
            return int(line.split()[1]) * 1024
    raise LookupError(key)


def _forget_peak() -> None:
    """Have the peak of resident memory counted from now on."""
    gc.collect(0)
    Path("/proc/self/clear_refs").write_text("5")
