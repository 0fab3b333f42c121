"""A live view: an env that people step, reset, watch and disturb in the page."""

from pathlib import Path

import numpy as np

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import AnysimError, TaskError
from anysim.task.env import TaskEnv
from anysim_viewer.actor import NOTHING, Actor, names_of
from anysim_viewer.controls import Plots, Switches, Transport, Words, among
from anysim_viewer.drawing import Drawing
from anysim_viewer.moment import Selection, cameras_of, looks_of, moment_of, picture
from anysim_viewer.mover import Movable, Mover, movables, pose_of, put
from anysim_viewer.page import Page
from anysim_viewer.video import Video
from anysim_viewer.view import View


class Curve:
    """What is drawn of one env's episode, step by step."""

    def __init__(self) -> None:
        self.steps: list[int] = []
        self.reward: list[float] = []
        self.success: list[bool] = []

    def begin(self) -> None:
        """A new episode."""
        self.steps, self.reward, self.success = [], [], []

    def add(self, step: int, reward: float, success: bool) -> None:
        """A step is complete."""
        self.steps.append(step)
        self.reward.append(reward)
        self.success.append(success)

    @property
    def total(self) -> float:
        """The sum of the rewards."""
        return float(np.nansum(self.reward))

    def show(self, plots: Plots) -> None:
        """Draw it."""
        plots.show(np.array(self.steps), np.array(self.reward), np.array(self.success))


def refusals_of(env: TaskEnv) -> dict[str, str]:
    """Why something cannot be shown of an env, by its name in the page."""
    engine, found = env.engine, {}
    if Capability.CONTACT_POINTS not in engine.capabilities:
        found["contacts"] = f"{engine.name} tells no points of contact"
    if not cameras_of(engine):
        found["camera"] = f"{engine.name} draws no images"
    if not env.scene.poses:
        found["goals"] = "this task has no goals that are poses"
    if not env.engine.world.robots:
        found["tools"] = "this world has no robot"
    if not (env.families is not None and any(env.families.family(n).drawn for n in env.spec.world.families or {})):
        found["matter"] = "this world has no matter beside the engine's bodies"
    return found


class LiveView(View):
    """An env on a page. Close it to end a video that is being made.

    Attributes:
        env: that is shown.
        i: the env of it that is looked at.
        seed: of the next reset.
    """

    def __init__(
        self, page: Page, env: TaskEnv, seed: int, *, policy: str | None = None, play: bool = False, out: Path
    ) -> None:
        """Begin the first episodes.

        Args:
            policy: who acts at first, and can be chosen again; nobody where not given.
            play: whether time goes on at once.
            out: where videos go.
        """
        super().__init__(page)
        self.env, self.i, self.seed, self._out = env, 0, seed, out
        self.dt = env.engine.world.physics.control_dt
        self._actor = Actor(env, NOTHING if policy is None else policy)
        self._curve, self._changes = Curve(), -1
        self._wanted, self._drawing = Selection(), Drawing(page, env.engine.world)
        self._build(names_of(env, policy), play)
        self.reset()

    def _build(self, actors: tuple[str, ...], play: bool) -> None:
        self._actors, self._cameras = actors, cameras_of(self.env.engine)
        page, gui = self.page, self.page.server.gui
        self._words = Words(page)
        with gui.add_folder("Run"):
            self.transport = Transport(page, self.forward, playing=play)
            reset = gui.add_button("Reset", hint="begin new episodes with the seed")
            seed = gui.add_number("seed", self.seed, min=0, step=1)
            again = gui.add_checkbox("begin anew", True, hint="where an episode has ended, while time goes on")
            who = gui.add_dropdown("acts", actors, initial_value=self._actor.name)
            if self.env.num_envs > 1:
                which = gui.add_slider("env", 0, self.env.num_envs - 1, 1, 0)
                which.on_update(lambda _: page.ask(lambda: self.choose_env(int(which.value))))
        reset.on_click(lambda _: page.ask(lambda: self.reset(int(seed.value))))
        who.on_update(lambda _: page.ask(lambda: self.choose_actor(str(who.value))))
        self._again = again
        self._switches = Switches(page, self._drawing, self._wanted, self._cameras, refusals_of(self.env))
        self._mover = Mover(page, movables(self.env), self.move)
        self._plots = Plots(page)
        with gui.add_folder("Video", expand_by_default=False):
            self._film = gui.add_dropdown("of", tuple(self._cameras) or ("none",), disabled=not self._cameras)
            self._record = gui.add_button("Record", disabled=not self._cameras, hint="an mp4 of what the camera sees")
        self._record.on_click(lambda _: page.ask(self.record))

    # ------------------------------------------------------------------ what can be asked

    def reset(self, seed: int | None = None) -> None:
        """Begin new episodes in all envs; those of a seed if one is given, at first those of `self.seed`."""
        self.seed = self.seed if seed is None else max(0, seed)
        self.env.reset(seed=self.seed)
        self._actor.begin(np.arange(self.env.num_envs))
        self._curve.begin()

    def choose_env(self, i: int) -> None:
        """Look at another env."""
        self.i, self._changes = min(max(i, 0), self.env.num_envs - 1), -1
        self._curve.begin()
        if self._video is not None:
            self.record()

    def choose_actor(self, name: str) -> None:
        """Have somebody else act, from the beginning of the same episodes: who acts may have planned from there."""
        made = Actor(self.env, among("policy", name, self._actors))
        self._actor = made
        self.env.reset(episode_seeds=[int(seed) for seed in self.env.streams.episode_seed])
        made.begin(np.arange(self.env.num_envs))
        self._curve.begin()

    def move(self, thing: Movable, pose: Array) -> None:
        """Put a goal or an object somewhere else."""
        if self.transport.playing and not thing.goal:
            raise TaskError(f"pause to move {thing.label}: while time goes on, physics alone moves it")
        put(self.env, self.i, thing, pose)

    def _begin_video(self, camera: str) -> Video:
        return Video(self.env, self.i, camera, picture(self.env, camera, self.i), self._out)

    # ------------------------------------------------------------------ time goes on

    def forward(self) -> None:
        """One control step of all envs; those that have ended begin anew, where that is chosen, or all rest."""
        env = self.env
        ended = ~env.running
        if ended.all() or (ended.any() and self._again.value):
            if self.transport.playing and not self._again.value:
                self.transport.play(False)
                return
            env.reset(mask=ended)
            self._actor.begin(np.flatnonzero(ended))
            if ended[self.i]:
                self._curve.begin()
        active = env.running
        ids = np.flatnonzero(active)
        result = env.step(self._actor.act(ids), None if active.all() else active)
        if active[self.i]:
            success = bool(result.info["is_success"][self.i])
            self._curve.add(int(result.info["elapsed_steps"][self.i]), float(result.reward[self.i]), success)
        env.retire(ids[self._actor.over(ids)])
        if self._video is not None and int(env.scene.elapsed[self.i]) % self._video.every == 0:
            self._video.add(picture(env, self._video.camera, self.i))

    def show(self) -> None:
        """Send what has changed."""
        changes = int(self.env.engine.appearance_changes[self.i])
        if changes != self._changes:
            self._drawing.look(looks_of(self.env.engine, self.i))
            self._changes = changes
        try:
            moment = moment_of(self.env, self.i, self._wanted)
        except AnysimError as error:
            if not self._wanted.camera:
                raise
            self._switches.refuse(error)
            moment = moment_of(self.env, self.i, self._wanted)
        self._drawing.show(moment)
        self._switches.show(moment.image)
        if self._mover.chosen is not None:
            self._mover.follow(pose_of(self.env, self.i, self._mover.chosen))
        self._curve.show(self._plots)
        self._words.say(self._line(moment.step, moment.time))

    def _line(self, step: int, seconds: float) -> str:
        env, task, i = self.env, self.env.spec.task, self.i
        status = str(env.status[i]) + (f" ({why})" if (why := self._why()) else "")
        if not env.running[i] and env.info["is_success"][i]:
            status = "success"  # also where who acts was done before the task's time was up
        horizon = f" of {task.horizon}" if task is not None else ""
        last = f"{self._curve.reward[-1]:.4g}" if self._curve.reward else "-"
        said = env.instruction(i)
        return (
            f"**{env.name}** on {env.engine.name} {env.engine.version}" + (f"\n\n*{said}*" if said else "") + "\n\n"
            f"env {i} of {env.num_envs}, episode seed {int(env.streams.episode_seed[i])}\n\n"
            f"step {step}{horizon}, {seconds:.2f} s, **{status}**\n\n"
            f"reward {last}, sum {self._curve.total:.4g}, acts: {self._actor.name}"
        )

    def _why(self) -> str:
        if self.env.info["fault"][self.i]:
            return self.env.engine.fault_reason(self.i)
        return "" if self.env.running[self.i] else self._actor.failure(self.i)
