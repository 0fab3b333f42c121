"""Playback: recorded episodes on a page, to be scrubbed through; nothing is simulated."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import AnysimError
from anysim.record.film import capture_of
from anysim.record.manifest import Manifest, read_manifest
from anysim.record.reader import TrajectoryReader
from anysim_film.stage import FilmOrder, Stage, Staged
from anysim_viewer.controls import Plots, Switches, Transport, Words, among
from anysim_viewer.drawing import Drawing
from anysim_viewer.moment import OVERVIEW, Matter, Moment, Selection, cameras_of, looks_of
from anysim_viewer.page import Page
from anysim_viewer.video import Video
from anysim_viewer.view import View

MOST_VALUES = 32
"""Components of an action that are written out."""


class Playback(View):
    """Recorded episodes of one run. Close it to free the engine that draws.

    Attributes:
        trajectories: that can be chosen.
        number: of the one that is shown.
        at: the row that is shown: of `steps`.
    """

    def __init__(self, page: Page, trajectories: Sequence[Path], order: FilmOrder, *, play: bool, out: Path) -> None:
        """Show the first of them.

        Raises:
            RecordError: it holds no poses, or is damaged.
            AnysimError: its world cannot be built.
        """
        super().__init__(page)
        self.trajectories, self.number, self.at, self._out = trajectories, 0, 0, out
        self._stage, self._wanted = Stage(order), Selection()
        self._drawing: Drawing | None = None
        self._play_at_once = play
        self.begin(0)

    # ------------------------------------------------------------------ what can be asked

    def begin(self, number: int) -> None:
        """Show another episode, from its beginning.

        Raises:
            RecordError: it holds no poses, or is damaged.
        """
        path = self.trajectories[number]
        manifest = read_manifest(path)
        staged: Staged = self._stage.begin(path, self._stage.load(manifest))
        reader = staged.reader
        self.manifest, self._staged, self.number, self.at = manifest, staged, number, 0
        self.dt = manifest.control_dt
        self.steps, self.poses = staged.moments.steps, staged.moments.body_pose
        self._times = reader.times_from_reset[self.steps]
        self._reward = _rows(reader.rewards, self.steps)
        self._status = ["running", *reader.statuses][-len(self.steps) :]
        self._language = [reader.language[0] if reader.language else "", *reader.language][-len(self.steps) :]
        self._annotations = [{}, *reader.annotations][-len(self.steps) :]
        self._actions = reader.actions
        self._matter = _matter(staged, reader)
        if self._drawing is None:
            self._build(staged)
        assert self._drawing is not None
        self._drawing.look(looks_of(staged.env.engine, 0))
        self._slider.max = len(self.steps) - 1
        self.seek(0)

    def seek(self, at: int) -> None:
        """Show another moment, by its row."""
        self.at = int(np.clip(at, 0, len(self.steps) - 1))
        if self._slider.value != self.at:
            self._slider.value = self.at

    def _begin_video(self, camera: str) -> Video:
        return Video(self._staged.env, 0, camera, self._picture(camera), self._out)

    def close(self) -> None:
        """Complete the video that is being made, and free the engine."""
        super().close()
        self._stage.close()

    # ------------------------------------------------------------------ time goes on

    def forward(self) -> None:
        """One recorded control step; at the end it stops, and from there it begins again."""
        if self.at == len(self.steps) - 1:
            if self.transport.playing:
                self.transport.play(False)
                return
            self.seek(0)
        else:
            self.seek(self.at + 1)
        if self._video is not None and int(self.steps[self.at]) % self._video.every == 0:
            self._video.add(self._picture(self._video.camera))

    def show(self) -> None:
        """Send what has changed."""
        assert self._drawing is not None
        env, at, image = self._staged.env, self.at, None
        if self._wanted.camera:
            try:
                image = self._picture(self._wanted.camera)
            except AnysimError as error:
                self._switches.refuse(error)
        goals = {name: poses[0] for name, poses in env.scene.poses.items()}
        matter = {name: family[self._row(steps)] for name, (steps, family) in self._matter.items()}
        step, seconds = int(self.steps[at]), float(self._times[at])
        self._drawing.show(Moment(step, seconds, self.poses[at], env.scene.presence[0], goals, matter, None, image))
        self._switches.show(image)
        success = np.array([status == "success" for status in self._status])
        self._plots.show(self.steps, self._reward, success, at)
        self._words.say(self._line(step, seconds))
        self._table.say(self._details())

    def _row(self, steps: Array) -> int:
        """The latest of the rows at these control steps."""
        return max(0, int(np.searchsorted(steps, self.steps[self.at], side="right")) - 1)

    def _picture(self, camera: str) -> Array:
        env, pose = self._staged.env, self.poses[self.at]
        if camera == OVERVIEW:
            image = env.engine.render("default", 480, 360, env_ids=[0], body_pose=pose[None])["rgb"]
            return capture_of(env).mark(image, "default", np.array([0]), pose[None])[0]
        return capture_of(env).image_then(camera, 0, int(self.steps[self.at]), pose)

    # ------------------------------------------------------------------ the page

    def _build(self, staged: Staged) -> None:
        page, gui, engine = self.page, self.page.server.gui, staged.env.engine
        self._drawing = Drawing(page, engine.world)
        self._words = Words(page)
        names = [path.name for path in self.trajectories]
        with gui.add_folder("Recording"):
            self._episode: Any = gui.add_dropdown("episode", tuple(names), initial_value=names[0])
            self._slider: Any = gui.add_slider("row", 0, max(1, len(self.steps) - 1), 1, 0, hint="row of the recording")
            self.transport = Transport(page, self.forward, playing=self._play_at_once)
        self._episode.on_update(
            lambda _: page.ask(lambda: self.begin(names.index(among("episode", self._episode.value, names))))
        )
        self._slider.on_update(lambda event: self._slid(event))
        cameras = self._cameras = cameras_of(engine)
        refusals = {"contacts": "contacts are not recorded"}
        if not cameras:
            refusals["camera"] = f"{engine.name} draws no images"
        if not self._matter:
            refusals["matter"] = "no points of matter were recorded; see record.streams.matter"
        self._switches = Switches(page, self._drawing, self._wanted, cameras, refusals)
        with gui.add_folder("Details"):
            self._table = Words(page)
        self._plots = Plots(page)
        with gui.add_folder("Video", expand_by_default=False):
            self._film = gui.add_dropdown("of", tuple(cameras) or ("none",), disabled=not cameras)
            self._record = gui.add_button("Record", disabled=not cameras, hint="an mp4 of what the camera sees")
        self._record.on_click(lambda _: page.ask(self.record))

    def _slid(self, event: Any) -> None:
        """The slider was moved: by a person, who has a client, or by `seek`, which has none."""
        if event.client is not None:
            at = int(self._slider.value)
            self.page.ask(lambda: self._sought(at))

    def _sought(self, at: int) -> None:
        self.transport.play(False)
        self.seek(at)

    def _line(self, step: int, seconds: float) -> str:
        m: Manifest = self.manifest
        said = self._language[self.at]
        drawn, recorded = self._staged.engines
        by = recorded if drawn == recorded else f"{recorded}, drawn by {drawn}"
        return (
            f"**{m.task}** on {by}" + (f"\n\n*{said}*" if said else "") + "\n\n"
            f"episode seed {m.episode_seed}, ended as **{m.status}**\n\n"
            f"step {step} of {m.steps}, {seconds:.2f} s, {self._status[self.at]}"
        )

    def _details(self) -> str:
        """The action that led here, the reward, and what was said of the step."""
        at, step = self.at, int(self.steps[self.at])
        lines = [f"reward {self._reward[at]:.4g}"]
        if step > 0:
            action = self._actions[step - 1]
            labels = self.manifest.layout.action
            pairs = list(zip(labels, action.tolist(), strict=True))[:MOST_VALUES]
            lines += ["", "| action | |", "|---|---|", *(f"| {name} | {value:.4f} |" for name, value in pairs)]
            left = len(action) - len(pairs)
            lines += [f"| and {left} more | |"] if left > 0 else []
        said = {key: value for key, value in dict(self._annotations[at]).items() if value not in (None, "", [], {})}
        if said:
            lines += ["", "| annotation | |", "|---|---|", *(f"| {k} | {_short(v)} |" for k, v in said.items())]
        return "\n".join(lines)


def _short(value: object) -> str:
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    text = text.replace("|", "/").replace("\n", " ")
    return text if len(text) <= 80 else text[:79] + "…"


def _rows(values: Array, steps: Array) -> Array:
    """Values (T,) of the steps 1 to T at `steps`, which may begin with step 0, where nothing was."""
    return np.concatenate([[0.0], values])[steps]


def _matter(staged: Staged, reader: TrajectoryReader) -> dict[str, tuple[Array, list[Matter]]]:
    """The recorded points of families: the control steps of the rows, and the rows."""
    found: dict[str, tuple[Array, list[Matter]]] = {}
    families = staged.env.families
    for name, info in reader.manifest.streams.items():
        kind, _, family = name.partition("/")
        if kind != "matter" or info.kind != "points" or families is None:
            continue
        rows, made = reader.stream(name), families.family(family)
        radius = float(next(iter(info.about.get("radius", ())), 0.01))
        faces, color = families.state(family).faces, np.array(made.color)
        points = [
            Matter(value, radius, faces[(faces < len(value)).all(axis=1)], color)
            for value in (np.asarray(value, dtype=np.float32) for value in rows.values)
        ]
        if points:
            found[family] = (np.asarray(rows.steps), points)
    return found
