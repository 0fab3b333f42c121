"""`script`: timed commands from a file, for tests and repeats."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from anysim.errors import SpecError, SpecIssue
from anysim_schemas.base import Spec
from anysim_schemas.load import load
from anysim_teleop.device import Button, DeviceInput, Frame, InputDevice, Job, Moment

Numbers = tuple[float, float, float]
_ROUNDING = 1e-9


class Move(Spec):
    """One command: a constant twist for some time, a gripper, a button."""

    for_: Annotated[float, Field(alias="for", ge=0, le=3600, description="[s], rounded to control steps")] = 0.0
    linear: Annotated[Numbers, Field(description="[m/s] velocity of the tool")] = (0.0, 0.0, 0.0)
    angular: Annotated[Numbers, Field(description="[rad/s] rate of the tool")] = (0.0, 0.0, 0.0)
    frame: Frame = "base"
    gripper: Literal["open", "close"] | None = None
    press: Literal["record", "discard", "quit", "switch"] | None = None  # a reset would come again and again


class Script(Spec):
    """The file of a script: its commands, in order."""

    moves: Annotated[tuple[Move, ...], Field(min_length=1, max_length=100_000)]


class ScriptDevice(InputDevice):
    """Timed commands from a YAML file, from its beginning in each episode; at its end the episode ends."""

    live: ClassVar[bool] = False

    def __init__(self, *, file: Annotated[str, Field(description="a YAML file with `moves`")]) -> None:
        """Read the file.

        Raises:
            SpecError: what is wrong in it, with line and column.
        """
        self._loaded = load(Script, [Path(file)])
        self._plan: list[tuple[int, Move]] = []
        self._place = self._left = 0

    def open(self, job: Job) -> None:
        """Count its control steps.

        Raises:
            SpecError: a move is faster than the session allows.
        """
        issues: list[SpecIssue] = []
        for number, move in enumerate(self._loaded.spec.moves):
            for key, most, option in (("linear", job.speed, "--speed"), ("angular", job.turn, "--turn")):
                fast = float(np.linalg.norm(getattr(move, key)))
                if fast > most * (1 + _ROUNDING):
                    path = f"moves.{number}.{key}"
                    text = f"{fast:.4g} is above {option} {most:g}; slow it down, or allow {option} {fast:.4g}"
                    issues.append(SpecIssue(self._loaded.provenance.get(path, ""), path, text))
        if issues:
            raise SpecError(issues)
        self._plan = [(round(move.for_ / job.control_dt), move) for move in self._loaded.spec.moves]
        self.begin()

    def begin(self) -> None:
        """From the first move on."""
        self._place = 0
        self._left = self._plan[0][0]

    def read(self, moment: Moment) -> DeviceInput:
        """The move of this control step, with the grippers and buttons of moves that take no time."""
        closed: bool | None = None
        buttons: list[Button] = []
        while True:
            if self._place >= len(self._plan):
                return DeviceInput(np.zeros(6), closed=closed, buttons=(*buttons, Button.RECORD))
            steps, move = self._plan[self._place]
            if self._left == steps:
                closed = closed if move.gripper is None else move.gripper == "close"
                buttons += [] if move.press is None else [Button(move.press)]
            if self._left > 0:
                self._left -= 1
                return DeviceInput(np.array([*move.linear, *move.angular]), move.frame, closed, tuple(buttons))
            self._place += 1
            if self._place < len(self._plan):
                self._left = self._plan[self._place][0]
