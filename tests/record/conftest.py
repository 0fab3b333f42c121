"""A run without an engine, and a writer whose every stage can be made to fail."""

import errno
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from anysim.record.columns import EpisodeColumns
from anysim.record.frame import RecordedFrame
from anysim.record.header import ArrayLayout, EpisodeHeader, Header, RunHeader, StateLayout
from anysim.record.writer import ImageWriter, TrajectoryWriter, WrittenFile
from anysim_recording.recorder import Recorder

LAYOUT = StateLayout(
    bodies=("cube",),
    joints=("a", "b"),
    actuators=("a", "b"),
    action=("a", "b"),
    state={"joint_pos": (2,), "body_pose": (1, 7)},
    obs={"policy": ArrayLayout(shape=(3,), dtype="float32")},
)


class Failing:
    """Fails as on a full disk at the stage that a test names."""

    fail_at: ClassVar[str] = ""

    def stage(self, stage: str) -> None:
        if self.fail_at == stage:
            raise OSError(errno.ENOSPC, "No space left on device")


class LineImages(ImageWriter):
    """The sums of all images, one file for each camera."""

    def __init__(self, directory: Path, header: Header, failing: Failing) -> None:
        self.failing = failing
        self.files = {name: (directory / f"{name}.txt").open("w") for name in header.episode.cameras}
        self.frames = dict.fromkeys(self.files, 0)

    def append(self, images: Mapping[str, Any]) -> None:
        self.failing.stage("append")
        for name, image in images.items():
            self.files[name].write(f"{image.sum()}\n")
            self.frames[name] += 1

    def finish(self) -> tuple[WrittenFile, ...]:
        self.failing.stage("finish")
        self.abort()
        return tuple(WrittenFile(f"{name}.txt", name, frames) for name, frames in self.frames.items())

    def abort(self) -> None:
        for file in self.files.values():
            file.close()


class LineWriter(Failing, TrajectoryWriter):
    """One line for each frame, in two files."""

    name: ClassVar[str] = "lines"

    def prepare(self, run: RunHeader) -> None:
        self.run = run

    def write(self, directory: Path, columns: EpisodeColumns, status: str) -> tuple[WrittenFile, ...]:
        assert columns.header.run == self.run
        self.stage("begin")
        files = {"states.txt": columns.state["joint_pos"], "actions.txt": columns.action}
        for name, rows in files.items():
            with (directory / name).open("w") as file:
                self.stage("write")
                file.writelines(f"{row.tolist()}\n" for row in rows)
        return tuple(map(WrittenFile, files))

    def open_images(self, directory: Path, header: Header) -> ImageWriter:
        self.stage("open")
        return LineImages(directory, header, self)


@pytest.fixture
def writer() -> LineWriter:
    return LineWriter()


@pytest.fixture
def run_header() -> RunHeader:
    return RunHeader(
        task="push",
        seed=7,
        engine="null",
        engine_version="1.0",
        world_hash="ab" * 32,
        control_dt=0.02,
        layout=LAYOUT,
        spec={"seed": 7, "limits": [float("inf"), 1.5]},
        packages={"numpy": "2.0"},
    )


@pytest.fixture
def make_frame() -> Callable[..., RecordedFrame]:
    def make(step: int, **changes: Any) -> RecordedFrame:
        generator = np.random.default_rng(step)
        frame = RecordedFrame(
            step=step,
            time=step * 0.02,
            action=None if step == 0 else generator.normal(size=2),
            state={"joint_pos": generator.normal(size=2), "body_pose": generator.normal(size=(1, 7))},
            reward=0.5 * step,
            obs={"policy": generator.normal(size=3).astype(np.float32)},
        )
        return frame._replace(**changes)

    return make


@pytest.fixture
def record(make_frame: Callable[..., RecordedFrame]) -> Callable[..., Path]:
    """Record one whole trajectory."""

    def run(recorder: Recorder, env: int = 0, episode: int = 0, steps: int = 3) -> Path:
        recorder.start(EpisodeHeader(env=env, episode=episode, episode_seed=11, drawn={"mass": np.float32(0.5)}))
        for step in range(steps + 1):
            recorder.append(env, make_frame(step))
        return recorder.commit(env, "success").wait()

    return run
