"""`keyboard`: the keys of a terminal, which is put back as it was when the device is closed."""

import os
import re
import select
import shutil
import sys
import termios
import time
import tty
from typing import Annotated, Any

from pydantic import Field

from anysim.errors import TaskError
from anysim_teleop.device import DeviceInput, InputDevice, Job, Moment
from anysim_teleop.keys import HELP, MOTIONS, KeyControl

_KEY = re.compile(rb"\x1b[\[O][0-9;]*[A-Za-z~]|.", re.DOTALL)
_NAMES: dict[bytes, str] = {
    b"\x1b[A": "ArrowUp", b"\x1b[B": "ArrowDown", b"\x1b[C": "ArrowRight", b"\x1b[D": "ArrowLeft",
    b"\x1bOA": "ArrowUp", b"\x1bOB": "ArrowDown", b"\x1bOC": "ArrowRight", b"\x1bOD": "ArrowLeft",
    b"\x1b[5~": "PageUp", b"\x1b[6~": "PageDown", b"\n": "Enter", b"\r": "Enter", b"\t": "Tab",
    b"\x7f": "Backspace", b"\x08": "Backspace",
}  # fmt: skip
REPEATS = 0.7
"""[s] within which a key that is still held from the last episode is seen again."""
_SHOWN_EVERY = 0.1
_WIPE = "\r\x1b[K"


def keys_of(data: bytes) -> list[str]:
    """The names of the keys in what a terminal sent."""
    found: list[bytes] = _KEY.findall(data)
    return [_NAMES.get(key, key.decode("latin-1")) for key in found]


class KeyboardDevice(InputDevice):
    """The keys of this terminal; ? shows them. A key moves the tool while it repeats, and a little when tapped."""

    def __init__(
        self,
        *,
        hold: Annotated[
            float, Field(gt=0, le=2, description="[s] a key acts after it was seen: terminals tell no release")
        ] = 0.15,
    ) -> None:
        self._hold = hold
        self._saved: list[Any] | None = None
        self._terminal = -1
        self._seen: dict[str, float] = {}
        self._old: set[str] = set()
        """Keys that are still held from the last episode."""
        self._shown = 0.0

    def open(self, job: Job) -> None:
        """Take keys one by one and unseen, and say what they do.

        Raises:
            TaskError: there is no terminal.
        """
        if not (sys.stdin.isatty() and sys.stdout.isatty()):
            raise TaskError(
                "the device 'keyboard' needs a terminal for input and output; start it in one, or choose another "
                "device (`anysim list devices`)"
            )
        self._control = KeyControl(job)
        self._terminal = sys.stdin.fileno()
        self._saved = termios.tcgetattr(self._terminal)
        tty.setcbreak(self._terminal)  # Ctrl-C stays what it is
        for line in HELP:
            self.tell(line)

    def begin(self) -> None:
        """Motion begins with keys that go down from here on."""
        self._old |= self._held(time.monotonic())
        self._control.forget()

    def read(self, moment: Moment) -> DeviceInput:
        """The keys that are held, and those that were pressed."""
        now = time.monotonic()
        for key in self._waiting():
            if key in MOTIONS:
                if now - self._seen.get(key, 0.0) > REPEATS:
                    self._old.discard(key)
                self._seen[key] = now
            elif key == "?":
                for line in HELP:
                    self.tell(line)
            else:
                self._control.press(key)
        if now - self._shown >= _SHOWN_EVERY:
            self._shown = now
            width = shutil.get_terminal_size().columns
            self._write(_WIPE + self._control.line(moment)[: width - 1])
        return self._control.take(moment, self._held(now) - self._old)

    def tell(self, line: str) -> None:
        """A line above the status."""
        self._write(f"{_WIPE}{line}\n")

    def close(self) -> None:
        """The terminal is as it was."""
        saved, self._saved = self._saved, None
        if saved is not None:
            termios.tcsetattr(self._terminal, termios.TCSAFLUSH, saved)
            self._write(_WIPE)

    def _held(self, now: float) -> set[str]:
        return {key for key, seen in self._seen.items() if now - seen < self._hold}

    def _waiting(self) -> list[str]:
        if not select.select([self._terminal], [], [], 0)[0]:
            return []
        data = os.read(self._terminal, 4096)
        if not data:  # the terminal is gone
            self._control.press("q")
        return keys_of(data)

    def _write(self, text: str) -> None:
        sys.stdout.write(text)
        sys.stdout.flush()
