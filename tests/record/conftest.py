"""A run without an engine, and a writer whose every stage can be made to fail."""

import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from anysim.record.frame import Frame
from anysim.record.header import ArrayLayout, EpisodeHeader, Header, RunHeader, StateLayout
from anysim.record.recorder import Recorder
from anysim.record.writer import TrajectoryWriter, WrittenFile

LAYOUT = StateLayout(
    bodies=("cube",),
    joints=("a", "b"),
    actuators=("a", "b"),
    action=("a", "b"),
    state={"joint_pos": (2,), "body_pose": (1, 7)},
    obs={"policy": ArrayLayout(shape=(3,), dtype="float32")},
)


class LineWriter(TrajectoryWriter):
    """One line per frame, in two files."""

    name: ClassVar[str] = "lines"
    fail_at: ClassVar[str] = ""

    def _stage(self, stage: str) -> None:
        if self.fail_at == stage:
            raise OSError(errno.ENOSPC, "No space left on device")

    def begin(self, directory: Path, header: Header) -> None:
        self.files = [(directory / name).open("w") for name in ("states.txt", "actions.txt")]
        self._stage("begin")

    def append(self, frame: Frame) -> None:
        self._stage("append")
        self.files[0].write(f"{frame.state['joint_pos'].tolist()}\n")
        self.files[1].write(f"{frame.action}\n")

    def finish(self, status: str) -> tuple[WrittenFile, ...]:
        self._stage("finish")
        for file in self.files:
            file.close()
        return (WrittenFile("states.txt"), WrittenFile("actions.txt"))

    def abort(self) -> None:
        for file in getattr(self, "files", []):
            file.close()


@pytest.fixture
def writer(monkeypatch: pytest.MonkeyPatch) -> type[LineWriter]:
    monkeypatch.setattr(LineWriter, "fail_at", "")
    return LineWriter


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
def make_frame() -> Callable[..., Frame]:
    def make(step: int, **changes: Any) -> Frame:
        generator = np.random.default_rng(step)
        frame = Frame(
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
def record(make_frame: Callable[..., Frame]) -> Callable[..., Path]:
    """Record one whole trajectory."""

    def run(recorder: Recorder, env: int = 0, episode: int = 0, steps: int = 3) -> Path:
        recorder.start(EpisodeHeader(env=env, episode=episode, episode_seed=11, drawn={"mass": np.float32(0.5)}))
        for step in range(steps + 1):
            recorder.append(env, make_frame(step))
        return recorder.commit(env, "success")

    return run
