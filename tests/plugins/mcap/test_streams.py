"""Streams of plugins in trajectories: each kind comes back as it was, and what is wrong harms that trajectory alone."""

import json
import re
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from anysim.api import load
from anysim.errors import PluginError, RecordError, SpecError
from anysim.record.columns import EpisodeColumns
from anysim.record.commit import describe
from anysim.record.header import StreamInfo
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.record.streams import StreamPart, StreamRow, StreamSource, make_sources
from anysim.record.writer import TrajectoryWriter, WrittenFile, make_writer
from anysim_inspect.verify import verify, verify_run
from anysim_recording.recorder import Recorder
from tests.plugins.mcap.everything import WORLD, made

INFOS = {
    "weather/rain": StreamInfo(kind="array", shape=(2, 2), dtype="int32", unit="mm", about={"legend": {"1": "rain"}}),
    "weather/wet": StreamInfo(kind="array", shape=(3,), dtype="bool"),
    "weather/range": StreamInfo(kind="image", shape=(3, 4), dtype="float32"),
    "weather/map": StreamInfo(kind="image", shape=(3, 4), dtype="uint16"),
    "weather/picture": StreamInfo(kind="image", shape=(3, 4, 3), dtype="uint8"),
    "weather/drops": StreamInfo(kind="points", shape=(None, 3), dtype="float32"),
    "weather/report": StreamInfo(kind="text"),
    "weather/none/of/it": StreamInfo(kind="data"),
    "weather/boxes": StreamInfo(kind="data"),
}


def values(step: int) -> dict[str, Any]:
    """A row of every stream but one."""
    noise = np.random.default_rng(step)
    return {
        "weather/rain": noise.integers(-9, 9, (2, 2)).astype(np.int32),
        "weather/wet": noise.random(3) < 0.5,
        "weather/range": np.where(noise.random((3, 4)) < 0.2, np.inf, noise.random((3, 4))).astype(np.float32),
        "weather/map": noise.integers(0, 1 << 16, (3, 4)).astype(np.uint16),
        "weather/picture": noise.integers(0, 256, (3, 4, 3)).astype(np.uint8),
        "weather/drops": noise.random((step, 3)).astype(np.float32),
        "weather/report": f"stép {step}",
        "weather/boxes": [{"name": "cube", "box": [1, 2.5, None]}] * (step % 3),
    }


class Weather(StreamSource):
    """Rows at every second step, made on the thread that is noted."""

    def __init__(self) -> None:
        self.streams = INFOS
        self.begun: list[int] = []
        self.made_by: set[int] = set()
        self.asked_by: set[int] = set()

    def begin(self, index: int) -> None:
        self.begun.append(index)

    def parts(self, index: int, columns: EpisodeColumns, status: str) -> Iterator[StreamPart]:
        assert (index, status) == (columns.header.episode.env, "success")
        self.asked_by.add(threading.get_ident())
        for step in range(0, columns.steps + 1, 2):
            yield StreamPart(lambda step=step: self.rows(step), 1000)

    def rows(self, step: int) -> list[StreamRow]:
        self.made_by.add(threading.get_ident())
        return [StreamRow(name, step, value) for name, value in values(step).items()]


def recorded(out: Any, sample: Any, source: StreamSource, steps: int = 6, number: int = 0) -> Any:
    with Recorder(out, make_writer("mcap", {}), sample.RUN, sources={"forecast": source}) as recorder:
        recorder.start(sample.episode(0, number))
        recorder.start(sample.episode(1, number))
        for step in range(steps + 1):
            recorder.append(0, sample.frame(step))
        recorder.discard(1)
        return recorder.commit(0, "success").wait()


def same(a: Any, b: Any) -> bool:
    if isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    return a == b


def test_every_kind_comes_back_by_name_with_its_times_and_types(tmp_path: Any, sample: Any) -> None:
    source = Weather()
    path = recorded(tmp_path, sample, source)
    assert verify(path) == []
    reader = open_trajectory(path)
    assert set(INFOS) < set(reader.names())
    for name in INFOS:
        stream = reader.stream(name)
        steps = [] if name == "weather/none/of/it" else [0, 2, 4, 6]
        assert stream.steps.tolist() == steps
        assert stream.times.tolist() == [step * 0.02 for step in steps]
        for step, value in zip(steps, stream.values, strict=True):
            assert same(value, values(step)[name]), name
    assert reader.stream("weather/map").values.shape == (4, 3, 4)
    assert reader.manifest.streams["weather/rain"].about == {"legend": {"1": "rain"}}
    assert (source.begun, source.asked_by) == ([0, 1], {threading.get_ident()})
    assert source.made_by.isdisjoint(source.asked_by)  # on the recorder's thread, and not for what was discarded


def test_every_array_of_every_trajectory_has_a_name(tmp_path: Any, sample: Any, record: Any) -> None:
    reader = open_trajectory(record(tmp_path, steps=5))
    found = {name: reader.stream(name) for name in reader.names()}
    assert same(found["state/body_pose"].values, reader.states_from_reset("body_pose"))
    assert found["state/body_pose"].steps.tolist() == [0, 1, 2, 3, 4, 5]
    assert found["observation/policy"].values.dtype == np.float32
    assert same(found["action"].values, reader.actions)
    assert found["collect/reward"].steps.tolist() == [1, 2, 3, 4, 5]
    assert found["language"].values == reader.language
    assert found["camera/front"].values.shape == (3, 48, 64, 3)
    assert found["camera/front"].times.tolist() == [0.0, 0.04, 0.08]
    first = open_trajectory(record(tmp_path / "late", first=1, steps=3, cameras={}))
    assert first.stream("state/joint_pos").steps.tolist() == [1, 2, 3]
    with pytest.raises(RecordError, match=r"has no stream 'state/joint_poses'.*state/joint_pos"):
        reader.stream("state/joint_poses")


def test_equal_runs_give_equal_files(tmp_path: Any, sample: Any) -> None:
    one, two = (recorded(tmp_path / name, sample, Weather()) for name in ("one", "two"))
    assert (one / "weather.mcap").read_bytes() == (two / "weather.mcap").read_bytes()


def test_sources_are_closed_where_nothing_can_be_recorded(tmp_path: Any, sample: Any) -> None:
    closed: list[str] = []

    class Closing(Weather):
        def __init__(self, name: str) -> None:
            super().__init__()
            self.name = name

        def close(self) -> None:
            closed.append(self.name)
            if self.name == "second":
                raise OSError("the device is gone")

    (tmp_path / "run").write_text("no directory")
    with pytest.raises(PluginError, match=r"'b'.*the device is gone"):
        Recorder(
            tmp_path / "run",
            make_writer("mcap", {}),
            sample.RUN,
            sources={"a": Closing("first"), "b": Closing("second"), "c": Closing("third")},
        )
    assert sorted(closed) == ["first", "second", "third"]
    with pytest.raises(RecordError, match="cannot record into"):
        Recorder(tmp_path / "run", make_writer("mcap", {}), sample.RUN, sources={"a": Closing("fourth")})
    assert closed[-1] == "fourth"


def test_sources_are_closed_where_another_one_cannot_be_made(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[str] = []
    with made() as env:
        monkeypatch.setattr("anysim_mcap.camera_channels.CameraChannels.close", lambda self: closed.append("cameras"))
        monkeypatch.setattr("anysim_annotation.stream.AnnotationStream.close", lambda self: closed.append("labels"))
        monkeypatch.setattr("anysim_language.stream.LanguageStream.__init__", _fails)
        with pytest.raises(PluginError, match="no words"):
            make_sources(env)
    assert closed == ["labels"]  # the cameras' come last


def _fails(*_: Any, **__: Any) -> None:
    raise OSError("no words")


class Wrong(Weather):
    """One row that is not right."""

    def __init__(self, row: StreamRow | None) -> None:
        super().__init__()
        self._row = row

    def rows(self, step: int) -> list[StreamRow]:
        if self._row is None:
            raise ValueError("no forecast")
        return [*super().rows(step), self._row] if step == 4 else super().rows(step)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (StreamRow("weather/rain", 4, np.zeros((2, 2))), "array \\(2, 2\\) of float64; an array \\(2, 2\\) of int32"),
        (StreamRow("weather/rain", 4, np.zeros((2, 3), np.int32)), "array \\(2, 3\\) of int32"),
        (StreamRow("weather/report", 4, ["no"]), "has list; text expected"),
        (StreamRow("weather/sun", 4, "no"), "of the stream 'weather/sun' at step 4"),
        (StreamRow("weather/report", 7, "no"), "at step 7, of 6"),
        (StreamRow("weather/report", 3, "no"), "step 3 after one of step 4"),
        (None, "the streams 'forecast' of .*no forecast"),
    ],
)
def test_what_is_wrong_loses_that_trajectory_alone(tmp_path: Any, sample: Any, row: Any, message: str) -> None:
    with pytest.raises(Exception, match=message):
        recorded(tmp_path, sample, Wrong(row))
    assert trajectories(tmp_path) == []
    assert recorded(tmp_path, sample, Weather(), number=1)
    assert verify_run(tmp_path) == {"env_0000_episode_0001": []}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["episodes", "run.json"]


@pytest.mark.parametrize("name", ["weather", "state/x", "trajectory/x", "Weather/x", "weather/", "a/../b"])
def test_a_name_that_cannot_be_is_refused(tmp_path: Any, sample: Any, name: str) -> None:
    source = Weather()
    source.streams = {name: INFOS["weather/wet"]}
    with pytest.raises(RecordError, match="a stream cannot be called"):
        recorded(tmp_path, sample, source)
    assert trajectories(tmp_path) == []


def test_a_writer_without_streams_refuses_them(tmp_path: Any, sample: Any) -> None:
    class Bare(TrajectoryWriter):
        name = "bare"

        def write(self, directory: Any, columns: EpisodeColumns, status: str) -> tuple[WrittenFile, ...]:
            return ()

    with Recorder(tmp_path, Bare(), sample.RUN, sources={"forecast": Weather()}) as recorder:
        recorder.start(sample.episode(0, 0, {}))
        for step in range(3):
            recorder.append(0, sample.frame(step, {}))
        with pytest.raises(RecordError, match="the writer 'bare' writes no streams"):
            recorder.commit(0, "success").wait()


def test_verify_finds_streams_that_contradict_the_manifest(tmp_path: Any, sample: Any) -> None:
    path = recorded(tmp_path, sample, Weather())
    text = (path / "manifest.json").read_text()
    other = recorded(tmp_path / "other", sample, Weather(), steps=8)
    for name, changed, message in (
        ("rows", lambda m: m["streams"]["weather/wet"].update(rows=3), "4 rows of weather/wet; the manifest says 3"),
        ("shape", lambda m: m["streams"]["weather/map"].update(shape=[4, 3]), "no \\(4, 3\\) of uint16"),
        ("kind", lambda m: m["streams"]["weather/map"].update(kind="array"), "not of the schema anysim.Array"),
    ):
        manifest = json.loads(text)
        changed(manifest)
        (path / "manifest.json").write_text(json.dumps(manifest))
        (fault,) = verify(path)
        assert re.search(message, fault), (name, fault)
    manifest = json.loads(text)
    (path / "weather.mcap").write_bytes((other / "weather.mcap").read_bytes())
    manifest["files"]["weather.mcap"] = describe(path / "weather.mcap").model_dump(mode="json")
    (path / "manifest.json").write_text(json.dumps(manifest))
    assert "step 8, of 6" in verify(path)[0]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("record.channels.back=[depth]", "there is no camera 'back'"),
        ("record.channels.top=[segmentation]", "gives no segmentation; add it to world.cameras.top.channels"),
    ],
)
def test_channels_that_no_camera_gives_are_refused_in_the_file(override: str, message: str) -> None:
    with pytest.raises(SpecError, match=message):
        load(WORLD, overrides=[override])
