"""Deferred filming: images of an episode that are drawn when it has ended are those of the episode, to the pixel."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.api import load
from anysim.engine.base import SimEngine
from anysim.errors import RecordError, SpecError
from anysim.record.columns import EpisodeColumns
from anysim.record.film import draw_recorded, film_mode, hindrances
from anysim.record.header import EpisodeHeader, Header
from anysim.record.manifest import read_manifest
from anysim.record.names import trajectories
from anysim.record.writer import TrajectoryWriter
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.task.terms import TERMS
from anysim.testing.engines import require_drawing
from anysim_inspect.cli.check import report_on
from anysim_inspect.verify import verify
from anysim_recording.collector import Collector, run_header
from tests.tiers import often

ENGINES = ("mujoco", "pybullet", "sapien")
CAMERAS = ("front", "wrist")
SEEN = (
    "world.objects.cube.source={choice: [{box: [0.05, 0.05, 0.05]}, {sphere: 0.03}]}",
    "world.objects.cube.texture={choice: [checker, brick, {pattern: noise, seed: 7}]}",
    "world.objects.cube.material={choice: [plastic, metal, matte]}",
    "world.objects.toy={source: {box: [0.05, 0.05, 0.1]}, count: {range: [0, 2]}, color: {choice: [red, blue, white]}}",
    "world.layout.toy={on: table, x: {range: [0.3, 0.6]}, y: {range: [-0.3, 0.3]}}",
    "world.lights.key={direction: {range: [[-0.5, -0.5, -1.0], [0.5, 0.5, -0.6]]}, intensity: {range: [0.3, 0.9]}}",
    "world.scenery={ambient: {range: [[0.1, 0.1, 0.1], [0.4, 0.4, 0.4]]}, "
    "background: {range: [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]}}",
    "world.cameras.front.size=[80, 60]", "world.cameras.wrist.size=[60, 80]",
    "world.cameras.front.fov={range: [30.0, 60.0]}", "world.cameras.front.exposure={range: [0.7, 1.3]}",
    "world.cameras.wrist.noise={range: [0.02, 0.06]}", "record.fps=50",
    "task.success={at_goal: null, at_rest: null, there: {term: present, object: cube}}", "task.hold=100",
)  # fmt: skip
"""Something of all that images depend on: what is there, textures, lights, a camera that rides, lens and noise."""


def filmed_env(engine: str, num_envs: int, *more: str) -> TaskEnv:
    """pick_cube with looks that differ between episodes, and shadows where the engine casts any."""
    require_drawing(engine)
    shadows = [] if engine == "sapien" else ["world.scenery.shadows=true"]
    return anysim.make("pick_cube", engine=engine, num_envs=num_envs, overrides=[*SEEN, *shadows, *more])


def recorded(env: TaskEnv, steps: int) -> tuple[list[dict[str, Any]], np.ndarray]:
    """Live images (N, H, W, 3) by camera after each step of a run, and the body poses (N, T, B, 7)."""
    assert env.capture is not None
    everyone, rng = np.arange(env.num_envs), np.random.default_rng(3)
    live, poses = [], []
    for step in range(steps + 1):
        if step:
            env.step(rng.uniform(-1.0, 1.0, (env.num_envs, env.action_dim)))
        live.append({camera: env.capture.picture(camera, everyone) for camera in CAMERAS})
        poses.append(np.array(env.engine.get_state().body_pose))
    return live, np.stack(poses, axis=1)


def columns_of(env: TaskEnv, poses: np.ndarray) -> EpisodeColumns:
    """An episode with these body poses (T, B, 7), and nothing else in it."""
    header = Header(run_header(env, 0), EpisodeHeader(env=0, episode=0, episode_seed=0))
    zeros = np.zeros(len(poses))
    return EpisodeColumns(header, 0, zeros, zeros[:, None], {"body_pose": poses}, zeros, {}, (), (), (), {})


def assert_filmed(env: TaskEnv, index: int, live: list[dict[str, Any]], row: int, poses: np.ndarray) -> None:
    columns, since = columns_of(env, poses[row]), int(env.engine.appearance_changes[index])
    for step, images in enumerate(live):
        drawn = draw_recorded(env, index, since, columns, step, CAMERAS)
        for camera in CAMERAS:
            assert np.array_equal(drawn[camera], images[camera][row]), f"{camera}, step {step}"


@pytest.mark.parametrize("engine", often(["mujoco"], ENGINES))
def test_images_of_a_finished_episode_are_those_of_the_episode(engine: str) -> None:
    """In the env that it ran in, and in another one that begins it and never moves, over three episodes."""
    with filmed_env(engine, 3) as env, filmed_env(engine, 1) as other:
        env.reset(seed=5)
        live, poses = recorded(env, 4)
        present = env.engine.presence
        assert not (present == present[0]).all(), "the episodes must differ in what is there"
        first, last = live[0], live[-1]
        assert all(not np.array_equal(first[c][i], last[c][i]) for c in CAMERAS for i in range(3))
        for i in range(3):
            assert_filmed(env, i, live, i, poses)
            other.reset(episode_seeds=[int(env.streams.episode_seed[i])])
            assert_filmed(other, 0, live, i, poses)


def test_filming_leaves_the_run_alone() -> None:
    """Episodes go on with the same bits, and their next images are of the present."""
    with filmed_env("mujoco", 2) as env, filmed_env("mujoco", 2) as clean:
        for one in (env, clean):
            one.reset(seed=5)
        live, poses = recorded(env, 3)
        recorded(clean, 3)
        assert_filmed(env, 1, live, 1, poses)
        assert np.array_equal(recorded(env, 2)[1], recorded(clean, 2)[1])
        assert env.capture is not None
        assert clean.capture is not None
        assert np.array_equal(env.capture.image("wrist", np.arange(2)), clean.capture.image("wrist", np.arange(2)))


def _without_a_toy(engine: SimEngine) -> np.ndarray:
    """What is in env 0, with one of its toys more or less."""
    row = engine.presence[[0]]
    toy = next(slot.entities[0] for slot in engine.world.slots if slot.name.startswith("toy"))
    row[0, toy] = not row[0, toy]
    return row


CHANGES: dict[str, Callable[[SimEngine], object]] = {
    "a colour": lambda e: e.set_parameters("geom.color", [0.1, 0.2, 0.3, 1.0], [0], [0]),
    "a light": lambda e: e.set_parameters("world.ambient", [[[0.5, 0.5, 0.5]]], [0]),
    "a camera": lambda e: e.set_camera_pose("front", [0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0], [0]),
    "a lens": lambda e: e.set_camera_fov("front", [20.0], [0]),
    "what is there": lambda e: e.reset([0], present=_without_a_toy(e)),
    "a snapshot": lambda e: e.restore(e.snapshot([0]), [0]),
    "a thing more": lambda e: e.add_object("rod", {"box": [0.1, 0.1, 0.1]}, fixed=True, position=(0.0, 0.0, 3.0)),
}


@pytest.mark.parametrize("what", CHANGES)
def test_what_was_changed_midway_is_not_filmed(what: str) -> None:
    """It is not recorded, so the images would be others; motion and what is felt are no such change."""
    with filmed_env("mujoco", 2) as env:
        env.reset(seed=5)
        before = env.engine.appearance_changes.copy()
        _, poses = recorded(env, 1)
        env.engine.set_parameters("body.mass", [[0.3]], [0], [env.engine.index.body("cube~0")])
        assert (env.engine.appearance_changes == before).all()
        CHANGES[what](env.engine)
        with pytest.raises(RecordError, match="changed after the reset"):
            draw_recorded(env, 0, int(before[0]), columns_of(env, poses[0]), 1, ["front"])
        if what != "a thing more":  # in the other env nothing was changed
            draw_recorded(env, 1, int(before[1]), columns_of(env, poses[1]), 1, ["front"])


# ---------------------------------------------------------------------- a run that films what it keeps

SHORT = ("task.horizon=6", "record.fps=25", "record.cameras=[front, wrist]", "record.keep=all")


def collected(out: Path, engine: str, *more: str) -> Iterator[tuple[TaskEnv, Collector]]:
    """A run of five short episodes in two envs, before and after."""
    with filmed_env(engine, 2, *SHORT, *more) as env:
        collector = Collector(env, SkillPolicy(env), out, 5, 0)
        yield env, collector
        list(collector.run())
        yield env, collector


RUNS = [
    pytest.param("mujoco", (), id="mujoco"),
    pytest.param("mujoco", ("engine.shards=2",), id="mujoco in two processes", marks=pytest.mark.slow),
    pytest.param("pybullet", (), id="pybullet", marks=pytest.mark.slow),
    pytest.param("sapien", (), id="sapien", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("engine", "more"), RUNS)
def test_a_run_filmed_later_writes_the_files_of_one_filmed_live(
    engine: str, more: tuple[str, ...], tmp_path: Path
) -> None:
    """The same manifests but for clock and the word itself, and the same bytes of numbers and videos."""
    for mode in ("live", "success"):
        *_, (_, collector) = collected(tmp_path / mode, engine, f"record.film={mode}", *more)
        parts = collector.times.parts()
        assert parts["draw"] > 0
        assert min(parts.values()) >= 0
    live, later = trajectories(tmp_path / "live"), trajectories(tmp_path / "success")
    assert [path.name for path in live] == [path.name for path in later]
    assert len(live) == 5
    for ours, theirs in zip(later, live, strict=True):
        manifests = [json.loads((path / "manifest.json").read_text()) for path in (ours, theirs)]
        assert [m["spec"]["record"].pop("film") for m in manifests] == ["success", "live"]
        assert all(m.pop("clock") for m in manifests)
        assert len(manifests[0]["cameras"]) == 2
        for name in ("front.mp4", "wrist.mp4"):
            assert (ours / name).read_bytes() == (theirs / name).read_bytes()
        for manifest in manifests:  # the spec is an attachment of it
            assert manifest["files"].pop("trajectory.mcap")
        assert list(manifests[0]) == list(manifests[1])
        assert manifests[0] == manifests[1]
        assert verify(ours) == []


def at_each_step(collector: Collector, look: Callable[[int], object]) -> None:
    """Have `look` called with 0, 1, 2… before the policy decides on each action."""
    act, calls = collector.policy.act, count()

    def look_and_act(env_ids: np.ndarray) -> np.ndarray:
        look(next(calls))
        return act(env_ids)

    collector.policy.act = look_and_act


@pytest.mark.parametrize("keep", ["all", "success"])
def test_only_what_is_kept_is_drawn(keep: str, tmp_path: Path) -> None:
    """When it has ended, and not in the steps before; of the short episodes here none succeeds."""
    run = collected(tmp_path, "mujoco", f"record.keep={keep}")
    env, collector = next(run)
    assert env.capture is not None
    drawn: list[float] = []
    at_each_step(collector, lambda _: drawn.append(env.capture.draw_seconds))
    next(run)
    assert drawn[:6] == [0.0] * 6
    assert len(drawn) == 18
    assert (drawn[6] > 0) == (keep == "all")
    assert (env.capture.draw_seconds > drawn[12]) == (keep == "all")
    assert len(trajectories(tmp_path)) == (5 if keep == "all" else 0)


def test_a_look_changed_midway_ends_the_run_and_leaves_whole_trajectories(tmp_path: Path) -> None:
    """It is not recorded, so what would be drawn is not what was there."""
    run = collected(tmp_path, "mujoco")
    env, collector = next(run)

    def repaint(call: int) -> None:
        if call == 9:  # each episode has six steps
            env.engine.set_parameters("geom.color", [0.1, 0.2, 0.3, 1.0], [1], [0])

    at_each_step(collector, repaint)
    with pytest.raises(RecordError, match=r"env 1 cannot be filmed: .* record with `record.film: live`"):
        next(run)
    there = trajectories(tmp_path)
    assert [path.name[4:] for path in there] == ["0000_episode_0000", "0000_episode_0001", "0001_episode_0000"]
    for path in there:
        assert len(read_manifest(path).cameras) == 2
        assert verify(path) == []
    assert not (tmp_path / ".incoming").exists()


KILLED_AT_AN_IMAGE = """
import os, signal, sys
from itertools import count
from pathlib import Path
from anysim.managers.camera import CaptureManager
from tests.record.test_film import collected

draw, images = CaptureManager.image_then, count(1)

def image_then(*args):
    if next(images) == int(sys.argv[2]):
        os.kill(os.getpid(), signal.SIGKILL)
    return draw(*args)

CaptureManager.image_then = image_then
list(collected(Path(sys.argv[1]), "mujoco"))
"""


@pytest.mark.slow
@pytest.mark.parametrize("image", [1, 13, 24], ids=lambda number: f"image {number}")
def test_kill_while_a_film_is_drawn(image: int, tmp_path: Path) -> None:
    """Of eight images in each episode: what is there is whole, and the next run sweeps the rest and completes it."""
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", KILLED_AT_AN_IMAGE, str(tmp_path), str(image)]
    assert subprocess.run(command, cwd=root, check=False).returncode == -signal.SIGKILL
    there = trajectories(tmp_path)
    assert len(there) <= (image - 1) // 8
    for path in there:
        assert verify(path) == []
    list(collected(tmp_path, "mujoco"))
    assert len(trajectories(tmp_path)) == 5
    for path in trajectories(tmp_path):
        assert len(read_manifest(path).cameras) == 2
        assert verify(path) == []
    assert not (tmp_path / ".incoming").exists()


# ---------------------------------------------------------------------- live or later


def repaint(scene: Any, draw: Any) -> None:
    """An event that a stranger might write."""


def _spec(monkeypatch: pytest.MonkeyPatch, *overrides: str) -> Any:
    monkeypatch.setitem(TERMS["event"], "repaint", repaint)
    return load("pick_cube", overrides=overrides).spec


PUSH = "task.events.wind={term: push, object: cube, force: [0.1, 0, 0], when: step}"
REPAINT = "task.events.paint={term: repaint, when: step}"


def test_films_are_made_later_where_they_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """By default; a push is not seen, whatever happens at the reset is drawn again, and observed images exist."""
    assert film_mode(_spec(monkeypatch)) == "success"
    assert film_mode(_spec(monkeypatch, "record.film=live")) == "live"
    assert film_mode(_spec(monkeypatch, PUSH, "record.film=success")) == "success"
    assert film_mode(_spec(monkeypatch, "task.events.paint={term: repaint}")) == "success"
    assert film_mode(_spec(monkeypatch, REPAINT)) == "live"
    assert film_mode(_spec(monkeypatch, "task.images.front={}")) == "live"
    assert film_mode(_spec(monkeypatch, "task.images.front={}", "record.film=success")) == "success"


def test_what_cannot_be_filmed_later_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        SpecError, match=r"record.film: episodes cannot be filmed .* the event 'paint' acts at each step"
    ):
        film_mode(_spec(monkeypatch, REPAINT, "record.film=success"))


def test_check_says_where_it_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    _spec(monkeypatch)
    fault, *more = report_on("pick_cube", None, False, [REPAINT, "record.film=success"]).faults
    assert more == []
    assert fault.startswith("-o record.film=success: record.film: episodes cannot be filmed")
    assert report_on("pick_cube", None, False, [PUSH, "record.film=success"]).faults == []


def test_a_writer_without_images_says_so_at_once(monkeypatch: pytest.MonkeyPatch, writer: TrajectoryWriter) -> None:
    """It is asked for the first image, and not when an episode has succeeded."""
    spec = _spec(monkeypatch)
    assert hindrances(spec) == []
    monkeypatch.setattr(registry, "load", lambda kind, name: type(writer))
    assert hindrances(spec) == []
    monkeypatch.setattr(type(writer), "open_images", TrajectoryWriter.open_images)
    assert hindrances(spec) == ["the writer 'mcap' writes no images"]
    assert film_mode(spec) == "live"


def test_a_goal_that_moves_is_filmed_live() -> None:
    path = "task.command.lead={term: goal_path, path: [[0.4, 0, 0.6], [0.5, 0, 0.6]], speed: 0.1}"
    moving = load("pick_cube", overrides=[path]).spec
    assert hindrances(moving) == ["the goal 'lead' moves, and where it was is not recorded"]
    assert film_mode(moving) == "live"
    latch = "task.events.bolt={term: tasks.latch, joint: cabinet.drawer_1, by: cabinet.drawer_2, position: 0.1}"
    assert hindrances(load("pick_cube", overrides=[latch]).spec) == []
    hidden = "task.events.hide={term: visibility, object: cube, when: step}"
    assert "the event 'hide' acts at each step" in hindrances(load("pick_cube", overrides=[hidden]).spec)[0]
