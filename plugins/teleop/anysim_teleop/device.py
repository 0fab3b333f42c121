"""The contract of an input device: what it is asked for in each control step, and what it is shown."""

import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import ClassVar, Literal, NamedTuple, Self

from anysim.conventions import Array

Frame = Literal["base", "tool"]
"""Axes of a twist: those of the robot's base, or the tool's own."""


class Button(StrEnum):
    """What a device can ask for beside motion.

    `record` ends the episode as it is, and before the first motion starts its clock. `reset` forgets the episode and
    begins the same one again. `discard` forgets it and goes on with the next. `quit` forgets it and ends the session.
    `switch` hands the device to the next arm.
    """

    RECORD = "record"
    RESET = "reset"
    DISCARD = "discard"
    QUIT = "quit"
    SWITCH = "switch"


class DeviceInput(NamedTuple):
    """What a device wants in one control step.

    Attributes:
        twist: (6,) of the tool: velocity [m/s] of its origin and rate [rad/s], in the axes of `frame`.
        frame: those axes.
        closed: whether the gripper is to be closed; None leaves it as it is.
        buttons: pressed since the last step, in order.
    """

    twist: Array
    frame: Frame = "base"
    closed: bool | None = None
    buttons: tuple[Button, ...] = ()

    @property
    def idle(self) -> bool:
        """Whether nothing is asked for."""
        return not self.twist.any() and self.closed is None and not self.buttons


class Job(NamedTuple):
    """What a device is told when it is opened.

    Attributes:
        task: its name; `instruction` is the task in words.
        engine: what simulates it.
        tools: the tools that can be driven, as `robot.tool`.
        control_dt: length of a control step [s].
        speed: the largest speed of the tool [m/s].
        turn: its largest rate [rad/s].
    """

    task: str
    instruction: str
    engine: str
    tools: tuple[str, ...]
    control_dt: float
    speed: float
    turn: float


class Moment(NamedTuple):
    """How things stand when a device is asked.

    Attributes:
        episode: its number; `episodes` is how many there are.
        waiting: the clock of the episode waits for the first input.
        time: simulated time since the reset [s].
        success: what each term of the task's success says.
        reward: of the last control step; `total` is the sum since the reset.
        tool: the one that is driven.
        closed: whether its gripper is told to be closed.
        picture: (H, W, 3) uint8 of the chosen camera, for devices that show pictures; None where there is no new one.
    """

    episode: int
    episodes: int
    waiting: bool
    time: float
    success: Mapping[str, bool] = MappingProxyType({})
    reward: float = 0.0
    total: float = 0.0
    tool: str = ""
    closed: bool = False
    picture: Array | None = None

    @property
    def line(self) -> str:
        """All of it in one line, for people."""
        terms = " ".join(f"{name}:{'yes' if true else 'no'}" for name, true in self.success.items())
        state = "waiting" if self.waiting else f"{self.time:6.2f} s"
        grip = "closed" if self.closed else "open"
        parts = (
            f"episode {self.episode + 1}/{self.episodes}",
            state,
            terms,
            f"return {self.total:.2f}",
            self.tool,
            grip,
        )
        return " | ".join(part for part in parts if part)


class InputDevice(ABC):
    """A source of commands for the tool. Keyword-only arguments of `__init__` are its options on the command line.

    Attributes:
        live: a person is at it: the simulation keeps to real time, and each episode waits for the first input.
        shows_pictures: it is shown the picture of a camera, several times a second.
    """

    live: ClassVar[bool] = True
    shows_pictures: ClassVar[bool] = False

    def open(self, job: Job) -> None:
        """Get ready, once, before the first episode.

        Raises:
            AnysimError: it cannot be used here; with the remedy.
        """

    def begin(self) -> None:
        """An episode has just been reset."""

    @abstractmethod
    def read(self, moment: Moment) -> DeviceInput:
        """What is wanted now. Asked once each control step, and while an episode waits; must not block."""

    def tell(self, line: str) -> None:
        """A line for the person: how an episode ended."""
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()

    def close(self) -> None:
        """Put back whatever `open` changed; also called where `open` failed, or never was."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
