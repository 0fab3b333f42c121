"""A view of a run that goes on: an observer that hands moments to a thread, which draws them."""

import threading
import time
from typing import NamedTuple, Self

import numpy as np

from anysim import hooks
from anysim.conventions import Array
from anysim.errors import AnysimError, TaskError
from anysim.task.contract import StepResult
from anysim.task.env import TaskEnv
from anysim_viewer.controls import Plots, Switches, Transport, Words
from anysim_viewer.drawing import Drawing
from anysim_viewer.gate import Access, fresh_token
from anysim_viewer.live import Curve, refusals_of
from anysim_viewer.moment import Moment, Selection, cameras_of, looks_of, moment_of
from anysim_viewer.page import Page
from anysim_viewer.solids import Looks
from anysim_viewer.view import RATE

PORT = 8480
"""Of a view, unless it is taken."""


class Sight(NamedTuple):
    """What the run's thread hands over."""

    moment: Moment
    looks: Looks | None
    words: str
    curve: tuple[list[int], list[float], list[bool]]


class RunView:
    """Shows an env while something else steps it. Nothing of the run changes; a pause only keeps it waiting.

    Within `with`: `with RunView(env) as view: ...`. At most `RATE` times a second, and while somebody looks, the
    stepping thread copies what is shown of one env; all else is done on a thread of the view.

    Attributes:
        url: of the page, with its token.
        handed: moments that were handed over so far.
    """

    def __init__(self, env: TaskEnv, port: int | None = None) -> None:
        """Serve the page on loopback: on `port`, or on the usual one, or on any where that is taken.

        Raises:
            TaskError: the port cannot be had.
        """
        self._env = env
        self._page = _page(env.name, port)
        self.url, self.handed = self._page.url, 0
        self._i, self._due, self._changes = 0, 0.0, -1
        self._curve, self._wanted = Curve(), Selection()
        self._drawing = Drawing(self._page, env.engine.world)
        self._closed, self._go = threading.Event(), threading.Event()
        self._sight: Sight | None = None
        self._new = threading.Condition()
        self._build()
        self._thread = threading.Thread(target=self._draw, name="view of a run", daemon=True)

    def _build(self) -> None:
        page, gui, env = self._page, self._page.server.gui, self._env
        self._words = Words(page)
        with gui.add_folder("Run"):
            self._transport = Transport(page, self._go.set, playing=True, with_speed=False)
            if env.num_envs > 1:
                which = gui.add_slider("env", 0, env.num_envs - 1, 1, 0)
                which.on_update(lambda _: self._choose(int(which.value)))
        self._switches = Switches(page, self._drawing, self._wanted, cameras_of(env.engine), refusals_of(env))
        self._plots = Plots(page)

    @property
    def watched(self) -> bool:
        """Whether somebody looks."""
        return self._page.watched

    def __enter__(self) -> Self:
        hooks.manager().register(self)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop looking, and free the port. Further calls do nothing."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._go.set()
        if hooks.manager().is_registered(self):
            hooks.manager().unregister(self)
        with self._new:
            self._new.notify_all()
        if self._thread.is_alive():
            self._thread.join()
        self._page.close()

    # ------------------------------------------------------------------ on the run's thread

    @hooks.hookimpl
    def before_episode(self, env: TaskEnv, env_ids: Array) -> None:
        """The curve of what is looked at begins anew."""
        if env is self._env and self._i in env_ids:
            self._curve.begin()
            self._due = 0.0

    @hooks.hookimpl
    def after_step(self, env: TaskEnv, result: StepResult) -> None:
        """Copy what is shown, where that is due and somebody looks; wait while the run is paused."""
        if env is not self._env:
            return
        i = self._i
        step = int(result.info["elapsed_steps"][i])
        if not self._curve.steps or step != self._curve.steps[-1]:  # an env that has ended waits for the others
            self._curve.add(step, float(result.reward[i]), bool(result.info["is_success"][i]))
        now = time.monotonic()
        if now >= self._due:
            self._due = now + 1.0 / RATE
            if self._page.watched:
                self._hand_over(i)
        while not self._transport.playing and self._page.watched and not self._closed.is_set():
            self._hand_over(self._i)
            if self._go.wait(1.0 / RATE):  # one step was asked for, or the view is closed
                self._go.clear()
                return

    @hooks.hookimpl
    def on_close(self, env: TaskEnv) -> None:
        """The env is gone."""
        if env is self._env:
            self.close()

    def _hand_over(self, i: int) -> None:
        env, looks = self._env, None
        changes = int(env.engine.appearance_changes[i])
        if changes != self._changes:
            looks, self._changes = looks_of(env.engine, i), changes
        try:
            moment = moment_of(env, i, self._wanted)
        except AnysimError as error:
            if not self._wanted.camera:
                raise
            self._switches.refuse(error)
            return
        curve = self._curve
        rows = curve.steps.copy(), curve.reward.copy(), curve.success.copy()
        with self._new:
            if looks is None and self._sight is not None:
                looks = self._sight.looks  # of one that was not drawn
            self._sight = Sight(moment, looks, self._line(i, moment), rows)
            self.handed += 1
            self._new.notify()

    def _line(self, i: int, moment: Moment) -> str:
        env = self._env
        return (
            f"**{env.name}** on {env.engine.name} {env.engine.version}, as it runs\n\n*{env.instruction(i)}*\n\n"
            f"env {i} of {env.num_envs}, episode seed {int(env.streams.episode_seed[i])}\n\n"
            f"step {moment.step}, {moment.time:.2f} s, **{env.status[i]}**, sum of rewards {self._curve.total:.4g}"
        )

    # ------------------------------------------------------------------ on the view's thread

    def _choose(self, i: int) -> None:
        self._i, self._changes = min(max(i, 0), self._env.num_envs - 1), -1
        self._curve.begin()

    def _draw(self) -> None:
        while not self._closed.is_set():
            self._page.answer()
            with self._new:
                self._new.wait_for(lambda: self._sight is not None or self._closed.is_set(), timeout=0.1)
                sight, self._sight = self._sight, None
            if sight is None or self._closed.is_set():
                continue
            if sight.looks is not None:
                self._drawing.look(sight.looks)
            self._drawing.show(sight.moment)
            self._switches.show(sight.moment.image)
            steps, reward, success = sight.curve
            self._plots.show(np.array(steps), np.array(reward), np.array(success))
            self._words.say(sight.words)


def _page(title: str, port: int | None) -> Page:
    token = fresh_token()
    try:
        return Page(Access(port=PORT if port is None else port, token=token), title)
    except TaskError:
        if port is not None:
            raise
        return Page(Access(token=token), title)
