"""The loop of a view: time goes on, what people ask is done, and what has changed is shown, all on one thread."""

import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from anysim.errors import AnysimError
from anysim_viewer.controls import Transport, among
from anysim_viewer.page import Page
from anysim_viewer.video import Video

RATE = 20.0
"""Moments a second that are sent at most [Hz]."""
LATE = 0.2
"""Time that is not made up for when steps take longer than they simulate [s]."""


class View(ABC):
    """What is shown on a page, and stepped.

    Attributes:
        page: where.
        transport: its buttons; made by the class that derives.
        dt: simulated time of a step [s].
    """

    transport: Transport
    dt: float
    _cameras: Sequence[str]
    _film: Any
    _record: Any

    def __init__(self, page: Page) -> None:
        self.page = page
        self._watched = False
        self._video: Video | None = None

    @abstractmethod
    def forward(self) -> None:
        """Go one control step on."""

    @abstractmethod
    def show(self) -> None:
        """Send what there is to see now."""

    @abstractmethod
    def _begin_video(self, camera: str) -> Video:
        """A video of what a camera sees, with its first picture."""

    def record(self) -> None:
        """Begin a video, or complete the one that is being made."""
        if self._video is None:
            self._video = self._begin_video(among("camera", self._film.value, self._cameras))
            self._record.label = "Stop"
            return
        done, self._video = self._video, None
        self._record.label = "Record"
        self.page.tell(f"{done.finish()}: {done.frames} pictures")

    def close(self) -> None:
        """Complete the video that is being made."""
        if self._video is not None:
            self._video.finish()
            self._video = None

    def run(self, stop: threading.Event) -> None:
        """Go on until `stop` is set; `Page.ask` wakes the loop."""
        due = shown = time.monotonic()
        fresh = True
        while not stop.is_set():
            now = time.monotonic()
            wait = max(0.0, (due - now)) if self.transport.playing else 0.5
            if fresh and self.page.watched:
                wait = min(wait, max(0.0, shown - now))
            asked = self.page.answer(min(wait, 0.5))
            now = time.monotonic()
            if self.transport.playing and now >= due:
                fresh = self._step() or fresh
                due = max(due + self.dt / self.transport.speed, now - LATE)
            elif not self.transport.playing:
                due = now
            fresh = fresh or asked or self._arrived()
            if fresh and now >= shown and self.page.watched:
                self._show()
                fresh, shown = False, time.monotonic() + 1.0 / RATE

    def _step(self) -> bool:
        try:
            self.forward()
        except AnysimError as error:
            self.transport.play(False)
            self.page.tell(str(error), fault=True)
        return True

    def _show(self) -> None:
        try:
            self.show()
        except AnysimError as error:
            self.page.tell(str(error), fault=True)

    def _arrived(self) -> bool:
        """Whether somebody has just come."""
        before, self._watched = self._watched, self.page.watched
        return self._watched and not before
