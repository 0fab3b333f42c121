"""Programs that the page starts: views, runs and comparisons, each a process of its own."""

import re
import signal
import subprocess
import sys
import threading
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path

from anysim.errors import TaskError

AT_ONCE = 4
"""Programs that run at once."""
KEPT = 20
"""Programs that are listed, the ended ones too."""
LINES = 300
"""Of a program's output that are kept."""
_ADDRESS = re.compile(r"https?://[^\s]+")
_END_S = 20.0


@dataclass
class Program:
    """One that was started.

    Attributes:
        number: of it in addresses.
        words: of its command line.
        lines: the last ones that it printed.
        address: of the page that it serves; empty while it has not said so, and of one that serves none.
    """

    number: int
    words: tuple[str, ...]
    process: "subprocess.Popen[str]"
    lines: "deque[str]" = field(default_factory=lambda: deque(maxlen=LINES))
    address: str = ""

    @property
    def title(self) -> str:
        """The command as a person types it."""
        return " ".join(("anysim", *self.words))

    @property
    def state(self) -> str:
        """`running`, `done`, `stopped`, or how it failed."""
        code = self.process.poll()
        if code is None:
            return "running"
        return "done" if code == 0 else "stopped" if code < 0 else f"failed ({code})"


class Programs:
    """Those of one page; their output is read by a thread for each, so that none of them waits."""

    def __init__(self) -> None:
        self._programs: dict[int, Program] = {}
        self._last = 0
        self._lock = threading.Lock()

    def start(self, *words: str) -> Program:
        """Start `anysim WORDS`.

        Raises:
            TaskError: as many run as may.
        """
        with self._lock:
            running = [one for one in self._programs.values() if one.state == "running"]
            if len(running) >= AT_ONCE:
                told = ", ".join(one.title for one in running)
                raise TaskError(f"{AT_ONCE} programs run already ({told}); stop one of them first")
            self._last += 1
            process = subprocess.Popen(
                [sys.executable, "-u", "-m", "anysim.cli", *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
            )
            made = self._programs[self._last] = Program(self._last, words, process)
            for number in sorted(self._programs)[:-KEPT]:
                if self._programs[number].state != "running":
                    del self._programs[number]
        threading.Thread(target=_read, args=(made,), name=f"anysim app program {made.number}", daemon=True).start()
        return made

    def all(self) -> list[Program]:
        """All that are listed, the last one first."""
        with self._lock:
            return sorted(self._programs.values(), key=lambda one: -one.number)

    def get(self, number: int) -> Program | None:
        """One by its number."""
        return self._programs.get(number)

    def stop(self, program: Program) -> None:
        """Have it end, and end it where it does not."""
        if program.process.poll() is None:
            program.process.send_signal(signal.SIGINT)
            try:
                program.process.wait(_END_S)
            except subprocess.TimeoutExpired:
                program.process.kill()
                program.process.wait()

    def close(self) -> None:
        """Stop all of them."""
        for program in self.all():
            self.stop(program)


def _read(program: Program) -> None:
    assert program.process.stdout is not None
    with program.process.stdout as output:
        for line in output:
            program.lines.append(line.rstrip("\n"))
            if program.words[0] == "view" and not program.address and (found := _ADDRESS.search(line)):
                program.address = found.group()


def unused(root: Path, name: str) -> tuple[Path, int]:
    """A folder of a name that is not there yet, and its number."""
    number = next(k for k in range(1, 1_000_000) if not (root / f"{name}-{k:03d}").exists())
    return root / f"{name}-{number:03d}", number
