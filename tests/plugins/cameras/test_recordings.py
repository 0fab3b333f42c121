"""Recordings of events that cameras film while they fly: every channel, replays, and pairs that differ in physics."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import anysim
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.record.replay import replay
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_drawing
from anysim_collect import commands
from anysim_recording.collector import Collector
from tests.runtime.light import REAL

EVENTS = Path(__file__).parents[3] / "docs" / "examples" / "events.yaml"
SMALL = [f"world.cameras.{name}.size=[32, 24]" for name in ("round", "near", "top")]
SOON = ["task.success.over.steps=20", "world.objects.brick.count=1", *SMALL]
FLYING = {"round": "drone", "near": "hand"}


def _made(engine: str) -> TaskEnv:
    return anysim.make(EVENTS, engine=engine, num_envs=1, overrides=SOON)


@pytest.fixture(scope="module", params=[pytest.param(name, marks=pytest.mark.slow) for name in REAL])
def filmed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """An episode that was collected on an engine."""
    require_drawing(request.param)
    with _made(request.param) as env:
        results = Collector(env, SkillPolicy(env), tmp_path_factory.mktemp("filmed"), 1, 3).run()
        (path,) = [result.path for result in results if result.path is not None]
    return request.param, path


def test_each_channel_is_there_and_is_the_engines(filmed: tuple[str, Path]) -> None:
    """Poses, lenses, depth and segmentation of each frame, held against the same episode lived through again."""
    engine, path = filmed
    found = open_trajectory(path)
    names = {"language/scene", "language/instruction", "language/narration", "action", "state/joint_pos"}
    for camera in FLYING:
        names |= {f"camera/{camera}", f"camera/{camera}/depth", f"camera/{camera}/segmentation"}
        names |= {f"annotation/{camera}/camera"}
    assert names <= set(found.names())
    assert (path / "top.mp4").is_file()
    said = found.stream("language/instruction").values
    assert list(said) == ["A ball falls onto blocks on a stand."]
    with _made(engine) as env:
        env.reset(episode_seeds=[found.manifest.episode_seed])
        _compare(env, found)


def _compare(env: TaskEnv, found: TrajectoryReader) -> None:
    rows = {name: found.stream(name) for name in found.names() if name.startswith(("annotation/", "camera/"))}
    frames = 0
    for step in range(found.manifest.steps + 1):
        if step:
            env.step(np.zeros((1, 0)))
        for camera in FLYING:
            told = rows[f"annotation/{camera}/camera"]
            at = np.flatnonzero(np.asarray(told.steps) == step)
            if not len(at):
                continue
            frames += 1
            (record,) = told.values[int(at[0])]
            pose = env.engine.camera_poses(camera)[0]
            assert np.abs(np.array(record["pose"]) - pose).max() < 1e-8, "written with nine digits"
            focal = 12.0 / np.tan(np.radians(env.engine.camera_fov(camera)[0]) / 2)
            assert np.allclose(record["intrinsics"], [[focal, 0, 16], [0, focal, 12], [0, 0, 1]])
            seen = env.engine.render(camera, channels=("depth", "segmentation"))
            depth = np.minimum(seen["depth"][0], np.float32(record["far"]))
            for name, live in (("depth", depth), ("segmentation", seen["segmentation"][0])):
                kept = rows[f"camera/{camera}/{name}"]
                image = kept.values[int(np.flatnonzero(np.asarray(kept.steps) == step)[0])]
                if name == "depth":
                    assert np.array_equal(image, live)
                else:  # the same things apart, by the numbers of its own legend
                    pairs = set(zip(image.ravel().tolist(), live.ravel().tolist(), strict=True))
                    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})
    assert frames == 2 * (found.manifest.steps // 2 + 1)


def test_what_was_filmed_replays_to_the_bit(filmed: tuple[str, Path]) -> None:
    again = replay(filmed[1])
    assert again.identical, again.explanation


def test_cameras_fly_the_same_way_through_a_counterfactual(filmed: tuple[str, Path], tmp_path: Path) -> None:
    """A heavier ball falls otherwise, and no bit of the cameras' ways moves."""
    app = typer.Typer()
    commands.add_cli(app)
    words: list[Any] = ["counterfactual", str(EVENTS), "-e", filmed[0], "-k", "1", "--actions", "same", "--json"]
    words += ["--factor", "objects.hero.mass=2.0", "--out", str(tmp_path / "pair")]
    blind = ["record.cameras=[]", "record.channels=null", "record.streams=null", "task.horizon=60"]
    blind += [f"world.cameras.{name}.channels=[]" for name in ("round", "near", "top")]
    for override in ["task.success.over.steps=20", "world.objects.brick.count=1", *blind]:
        words += ["-o", override]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    told = json.loads((tmp_path / "pair" / "pairs.json").read_text())
    (pair,) = told["pairs"]
    same, changed = (open_trajectory(tmp_path / "pair" / "episodes" / pair[key]) for key in ("same", "changed"))
    bodies = list(same.manifest.layout.bodies)
    ball = [bodies.index(name) for name in bodies if name.startswith("hero")]
    cameras = [bodies.index(f"{robot}.roll_link") for robot in FLYING.values()]
    steps = min(len(same.states["body_pose"]), len(changed.states["body_pose"]))
    first, second = (np.asarray(one.states["body_pose"])[:steps] for one in (same, changed))
    assert not np.array_equal(first[:, ball], second[:, ball])
    assert np.array_equal(first[:, cameras], second[:, cameras])
    assert np.ptp(first[:, cameras, :3], axis=0).max() > 0.1, "they fly"
