"""Keys by the names that browsers give them, and what each does; shared by the terminal and the page."""

from collections.abc import Iterable, Mapping

import numpy as np

from anysim.conventions import Array
from anysim_teleop.device import Button, DeviceInput, Frame, Job, Moment

MOTIONS: Mapping[str, tuple[int, float]] = {
    "w": (0, 1.0), "s": (0, -1.0), "a": (1, 1.0), "d": (1, -1.0), "r": (2, 1.0), "f": (2, -1.0),
    "ArrowUp": (0, 1.0), "ArrowDown": (0, -1.0), "ArrowLeft": (1, 1.0), "ArrowRight": (1, -1.0),
    "PageUp": (2, 1.0), "PageDown": (2, -1.0),
    "o": (3, 1.0), "u": (3, -1.0), "i": (4, 1.0), "k": (4, -1.0), "j": (5, 1.0), "l": (5, -1.0),
}  # fmt: skip
"""Component of the twist, and its sign, of the keys that move the tool while they are held."""

BUTTONS: Mapping[str, Button] = {
    "Enter": Button.RECORD,
    "Backspace": Button.RESET,
    "x": Button.DISCARD,
    "q": Button.QUIT,
    "Tab": Button.SWITCH,
}

HELP = (
    "w/s a/d r/f or arrows and page keys: move along x, y, z    u/o i/k j/l: turn about x, y, z",
    "space: gripper    t: axes of base or tool    + -: speed    tab: next arm",
    "enter: start, or end and keep    backspace: begin again    x: discard    q: quit    ?: these keys",
)
"""The keys, in lines for people."""

SLOWEST = 0.1
_FASTER = 1.5


class KeyControl:
    """What keys have asked for since they were last asked.

    Attributes:
        frame: the axes of motions.
        share: of the session's speeds.
    """

    def __init__(self, job: Job) -> None:
        self._largest = np.repeat([job.speed, job.turn], 3)
        self.frame: Frame = "base"
        self.share = 0.5
        self._buttons: list[Button] = []
        self._grips = 0

    def press(self, key: str) -> bool:
        """A key went down that does something once; false for one that does not."""
        if key in BUTTONS:
            self._buttons.append(BUTTONS[key])
        elif key == " ":
            self._grips += 1
        elif key == "t":
            self.frame = "tool" if self.frame == "base" else "base"
        elif key in ("+", "=", "-"):
            factor = 1 / _FASTER if key == "-" else _FASTER
            self.share = min(1.0, max(SLOWEST, self.share * factor))
        else:
            return False
        return True

    def take(self, moment: Moment, held: Iterable[str], sticks: Array | None = None) -> DeviceInput:
        """The input of this control step; what was pressed is told once.

        Args:
            moment: now.
            held: keys that are down.
            sticks: (6,) in [-1, 1] of a gamepad, added to the keys.
        """
        motion = np.zeros(6) if sticks is None else np.array(sticks, dtype=float)
        for key in held:
            if key in MOTIONS:
                component, sign = MOTIONS[key]
                motion[component] += sign
        closed = None if self._grips % 2 == 0 else not moment.closed
        buttons, self._buttons, self._grips = tuple(self._buttons), [], 0
        return DeviceInput(np.clip(motion, -1.0, 1.0) * self._largest * self.share, self.frame, closed, buttons)

    def forget(self) -> None:
        """An episode begins: what was pressed in the last one is not meant for it."""
        self._buttons, self._grips = [], 0

    def line(self, moment: Moment) -> str:
        """How things stand, with the axes and the speed."""
        return f"{moment.line} | {self.frame} axes, {100 * self.share:.0f} % speed"
