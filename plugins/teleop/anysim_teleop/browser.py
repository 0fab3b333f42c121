"""`browser`: a page on this machine with the picture of a camera, that takes keys and gamepads."""

import io
import time
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim_teleop.device import DeviceInput, InputDevice, Job, Moment
from anysim_teleop.keys import KeyControl
from anysim_teleop.page_server import PageInput, PageServer

SILENCE = 0.4
"""[s] without a word from the page after which nothing is held any more: it was closed, or its tab is hidden."""
_SHOWN_EVERY = 0.1
_QUALITY = 80


class BrowserDevice(InputDevice):
    """A page on loopback, whose address with its token is printed: a picture, the keys of the terminal, gamepads."""

    shows_pictures: ClassVar[bool] = True

    def __init__(
        self, *, port: Annotated[int, Field(ge=0, le=65535, description="of 127.0.0.1; 0 for any that is free")] = 0
    ) -> None:
        self._port = port
        self._server: PageServer | None = None
        self._now = PageInput()
        self._heard = 0.0
        self._old: set[str] = set()
        """Keys that are still held from the last episode."""
        self._resting = False
        """Whether sticks count: not before they were let go in this episode."""
        self._shown = 0.0

    @property
    def url(self) -> str:
        """Of the page, with its token; empty before `open`."""
        return "" if self._server is None else self._server.url

    def open(self, job: Job) -> None:
        """Serve the page, and print its address.

        Raises:
            TaskError: the port is taken.
        """
        self._control = KeyControl(job)
        self._server = PageServer(self._port)
        super().tell(f"open {self.url} in a browser on this machine")

    def begin(self) -> None:
        """Motion begins with keys and sticks that are moved from here on."""
        self._old, self._resting = set(self._now.held), False
        self._control.forget()

    def read(self, moment: Moment) -> DeviceInput:
        """What the page has sent last; shows it the moment."""
        assert self._server is not None
        link, now = self._server.link, time.monotonic()
        latest, pressed = link.take()
        if latest is not None:
            self._now, self._heard = latest, now
        elif now - self._heard > SILENCE:
            self._now = PageInput()
        for key in pressed:
            self._control.press(key)
        if moment.picture is not None:
            link.show(self._control.line(moment), _jpeg(moment.picture))
        elif now - self._shown > _SHOWN_EVERY:
            self._shown = now
            link.show(self._control.line(moment))
        self._old &= set(self._now.held)
        sticks = np.array(self._now.sticks)
        self._resting = self._resting or not sticks.any()
        return self._control.take(moment, set(self._now.held) - self._old, sticks * self._resting)

    def tell(self, line: str) -> None:
        """In the terminal and on the page."""
        super().tell(line)
        if self._server is not None:
            self._server.link.tell(line)

    def close(self) -> None:
        """The port is free again."""
        server, self._server = self._server, None
        if server is not None:
            server.stop()


def _jpeg(picture: Array) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(picture).save(file, "JPEG", quality=_QUALITY)
    return file.getvalue()
