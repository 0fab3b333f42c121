"""Controls of the page: buttons, switches, pictures and plots. They hand on what people press and know no env."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from viser import Icon
from viser.uplot import Scale, Series

from anysim.conventions import Array
from anysim.errors import AnysimError, TaskError, listing
from anysim_viewer.drawing import Drawing
from anysim_viewer.moment import Selection
from anysim_viewer.page import Page

NO_CAMERA = "none"
MOST_POINTS = 600
"""Points of a curve that are sent."""
SLOWEST, FASTEST = 0.05, 4.0
"""Simulated seconds a second."""
_INK, _ACCENT = "#2f7ed8", "#e8710a"


def among(what: str, value: object, known: Sequence[str]) -> str:
    """What was chosen in the page: one of the choices that it was given, whatever comes over the wire.

    Raises:
        TaskError: none of them.
    """
    if value not in known:
        raise TaskError(f"there is no {what} {str(value)[:40]!r} to choose ({listing(known)})")
    return str(value)


class Transport:
    """Play and pause, one step, and the speed.

    Attributes:
        playing: whether time goes on.
        speed: simulated seconds a second, at most.
    """

    def __init__(
        self, page: Page, step: Callable[[], object], *, playing: bool = False, with_speed: bool = True
    ) -> None:
        gui = page.server.gui
        self.playing, self.speed = playing, 1.0
        self._play = gui.add_button("", color="teal")
        self._step = gui.add_button("Step", icon=Icon.PLAYER_SKIP_FORWARD, hint="one control step")
        hint = "simulated seconds a second, at most"
        slider = gui.add_slider("speed", SLOWEST, FASTEST, 0.05, 1.0, hint=hint, visible=with_speed)
        self._play.on_click(lambda _: page.ask(lambda: self.play(not self.playing)))
        self._step.on_click(lambda _: page.ask(lambda: self._once(step)))

        @slider.on_update
        def _(_: object) -> None:
            self.speed = min(max(float(slider.value), SLOWEST), FASTEST)

        self.play(playing)

    def play(self, on: bool) -> None:
        """Have time go on, or not."""
        self.playing = on
        self._play.label = "Pause" if on else "Play"
        self._play.icon = Icon.PLAYER_PAUSE if on else Icon.PLAYER_PLAY

    def _once(self, step: Callable[[], object]) -> None:
        self.play(False)
        step()


class Switches:
    """What is shown beside bodies, and the picture of a camera."""

    def __init__(
        self, page: Page, drawing: Drawing, wanted: Selection, cameras: Sequence[str], refusals: dict[str, str]
    ) -> None:
        """`refusals` say why something cannot be shown, by its name."""
        gui = page.server.gui
        self._wanted, self._page, self._cameras = wanted, page, cameras
        with gui.add_folder("Show"):
            for name in drawing.shown:
                box = gui.add_checkbox(
                    name, drawing.shown[name], disabled=name in refusals, hint=refusals.get(name, _HINTS[name])
                )
                box.on_update(lambda event, name=name: self._switch(drawing, name, bool(event.target.value)))
            scale = gui.add_slider("force", 0.1, 20.0, 0.1, 1.0, hint="length of the arrows of forces")

            @scale.on_update
            def _(_: object) -> None:
                drawing.force_scale = min(max(float(scale.value), 0.0), 100.0)

            self.camera = gui.add_dropdown(
                "camera",
                (NO_CAMERA, *cameras),
                disabled=not cameras,
                hint=refusals.get("camera", "its picture, as the engine draws it"),
            )
            self.camera.on_update(lambda _: page.ask(self._look))
            self._picture = gui.add_image(np.zeros((2, 2, 3), dtype=np.uint8), format="jpeg", visible=False)
            self._why = gui.add_markdown("", visible=False)

    def _switch(self, drawing: Drawing, name: str, on: bool) -> None:
        drawing.shown[name] = on
        if name in ("contacts", "matter"):
            setattr(self._wanted, name, on)
        self._page.ask(lambda: None)  # wakes the loop, which shows it

    def _look(self) -> None:
        self._wanted.camera = (
            "" if self.camera.value == NO_CAMERA else among("camera", self.camera.value, self._cameras)
        )
        self._why.visible = False
        if not self._wanted.camera:
            self._picture.visible = False

    def show(self, image: Array | None) -> None:
        """Show the picture of the chosen camera."""
        if image is None:
            return
        self._picture.image = image
        if not self._picture.visible:
            self._picture.visible = True

    def refuse(self, error: AnysimError) -> None:
        """Say why there is no picture, and ask for none any more."""
        self._wanted.camera, self._picture.visible = "", False
        self._why.content, self._why.visible = f"no picture: {error}", True


_HINTS = {
    "tools": "frames of the robots' tools",
    "goals": "where the task wants something to be",
    "contacts": "points of contact, and the forces in them",
    "matter": "points of fluids and grains",
}


class Plots:
    """Curves of an episode: the reward of each step and their sum, and whether the task's success holds."""

    def __init__(self, page: Page) -> None:
        gui, none = page.server.gui, np.zeros(1)
        with gui.add_folder("Plots"):
            self._reward = gui.add_uplot(
                (none, none, none, none),
                (
                    Series(label="step"),
                    Series(label="reward", stroke=_INK, width=1.5),
                    Series(label="sum", stroke=_ACCENT, width=1.5, scale="sum"),
                    Series(label="now", stroke="#d02020", width=0),
                ),
                scales={"x": Scale(time=False), "y": Scale(auto=True), "sum": Scale(auto=True)},
                title="reward",
                height=150,
            )
            self._status = gui.add_uplot(
                (none, none),
                (Series(label="step"), Series(label="success holds", stroke="#2a9d5c", width=1.5, fill="#2a9d5c33")),
                scales={"x": Scale(time=False), "y": Scale(auto=False, min=-0.05, max=1.05)},
                title="status",
                height=100,
            )

    def show(self, steps: Array, reward: Array, success: Array, now: int | None = None) -> None:
        """Draw curves (K,) over control steps; `now` marks a place in them."""
        if len(steps) == 0:
            return
        total = np.cumsum(np.nan_to_num(reward))
        keep = np.unique(np.linspace(0, len(steps) - 1, min(len(steps), MOST_POINTS)).astype(int))
        mark = np.full(len(steps), np.nan)
        if now is not None:
            mark[now] = reward[now]
            keep = np.union1d(keep, [now])
        x = steps[keep].astype(float)
        self._reward.data = (x, reward[keep].astype(float), total[keep], mark[keep])
        self._status.data = (x, success[keep].astype(float))


class Words:
    """A text that is sent when it changes."""

    def __init__(self, page: Page) -> None:
        self._node: Any = page.server.gui.add_markdown("")
        self._said = ""

    def say(self, text: str) -> None:
        """Show a text."""
        if text != self._said:
            self._node.content = self._said = text
