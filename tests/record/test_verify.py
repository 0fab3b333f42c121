import json
import os

import numpy as np
import pytest

from anysim import registry
from anysim.errors import PluginError, RecordError
from anysim.record.manifest import read_manifest, read_run
from anysim.record.reader import open_trajectory
from anysim_inspect.verify import verify, verify_run
from anysim_recording.recorder import Recorder

INSTALLED = registry.load


class ContentReader:
    """Finds what the test tells it to."""

    found: list[str] = []  # noqa: RUF012  replaced by tests
    late = 0.0

    def __init__(self, directory, manifest):
        self.directory, self.manifest = directory, manifest
        self.times = self.late + manifest.control_dt * np.arange(1, manifest.steps + 1)

    def faults(self):
        return self.found

    def nonsense(self):
        return []


@pytest.fixture
def committed(tmp_path, writer, run_header, record, monkeypatch):
    monkeypatch.setattr(registry, "load", lambda kind, name: {("readers", "lines"): ContentReader}[kind, name])
    with Recorder(tmp_path, writer, run_header) as recorder:
        record(recorder, env=1)
        return record(recorder, env=0, episode=3)


def test_a_whole_one_has_no_faults(committed):
    assert verify(committed) == []
    assert verify_run(committed.parent.parent) == {"env_0000_episode_0003": [], "env_0001_episode_0000": []}


def test_a_flipped_bit(committed):
    data = bytearray((committed / "states.txt").read_bytes())
    data[5] ^= 1
    (committed / "states.txt").write_bytes(data)
    (fault,) = verify(committed)
    assert fault == f"{committed / 'states.txt'} was changed after its commit (its SHA-256 differs)"


def test_a_shortened_file(committed):
    data = (committed / "states.txt").read_bytes()
    (committed / "states.txt").write_bytes(data[:-1])
    (fault,) = verify(committed)
    assert fault.endswith(f"has {len(data) - 1} bytes; {len(data)} were committed")


def test_missing_and_extra_files(committed):
    (committed / "states.txt").rename(committed / "other.txt")
    (committed / ".hidden").write_text("")
    assert verify(committed) == [
        f"{committed} lacks states.txt",
        f"{committed} has files that its manifest doesn't know: .hidden, other.txt",
    ]


def test_a_link_is_not_a_file(committed, tmp_path):
    target = tmp_path / "aside"
    (committed / "states.txt").rename(target)
    (committed / "states.txt").symlink_to(target)
    assert verify(committed) == [f"{committed / 'states.txt'} is not a plain file"]


def test_another_name(committed):
    moved = committed.rename(committed.parent / "env_0009_episode_0003")
    assert verify(moved) == [f"{moved} holds env 0, episode 3"]


def test_faults_of_the_content_are_reported(committed, monkeypatch):
    monkeypatch.setattr(ContentReader, "found", ["front.mp4 has 3 frames"])
    assert verify(committed) == ["front.mp4 has 3 frames"]


def test_times_that_are_not_those_of_control_steps(committed, monkeypatch):
    monkeypatch.setattr(ContentReader, "late", 0.001)
    assert verify(committed) == [
        f"{committed}: step 1 is at 0.021 s; with control steps of 0.02 s it should be at 0.02 s"
    ]


def test_a_missing_reader_is_no_damage(committed, monkeypatch):
    monkeypatch.setattr(registry, "load", INSTALLED)
    with pytest.raises(PluginError, match="no reader named 'lines' is installed"):
        verify(committed)


def test_a_missing_library_of_a_reader_is_no_damage(committed, monkeypatch):
    def faults(self):
        raise ModuleNotFoundError("No module named 'mcap'", name="mcap")

    monkeypatch.setattr(ContentReader, "faults", faults)
    with pytest.raises(PluginError, match="needs mcap, which is not installed"):
        verify(committed)


def change(path, **values):
    file = path / "manifest.json"
    data = json.loads(file.read_text())
    data.update(values)
    file.write_text(json.dumps(data))


def test_an_unknown_format_is_refused_with_a_sentence(committed):
    change(committed, format="anysim-trajectory-9")
    (fault,) = verify(committed)
    assert "has the format 'anysim-trajectory-9'; this version of anysim reads 'anysim-trajectory-1'" in fault
    with pytest.raises(RecordError, match="use the version of anysim that wrote it"):
        read_manifest(committed)


@pytest.mark.parametrize(
    "name", ["../../run.json", "/etc/passwd", "a/b", "..", ".", "", "manifest.json", ".x", "x" * 200, "a\x00b"]
)
def test_a_manifest_names_no_file_outside(committed, name):
    change(committed, files={name: {"bytes": 1, "sha256": "0" * 64}})
    with pytest.raises(RecordError, match="is damaged or was edited"):
        read_manifest(committed)


@pytest.mark.parametrize("name", ["manifest.json", "run.json"])
def test_a_pipe_or_a_device_does_not_hang(tmp_path, name):
    read = read_manifest if name == "manifest.json" else read_run
    os.mkfifo(tmp_path / name)
    with pytest.raises(RecordError, match="is a pipe, not a file"):
        read(tmp_path)
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(RecordError, match="is a device, not a file"):
        read(tmp_path)


def test_a_member_that_is_a_pipe_does_not_hang(committed):
    member = committed / sorted(read_manifest(committed).files)[0]
    member.unlink()
    os.mkfifo(member)
    assert verify(committed) == [f"{member} is not a plain file"]
    with pytest.raises(RecordError, match="is not a plain file"):
        open_trajectory(committed)


def test_a_recorded_spec_extends_nothing(committed):
    change(committed, spec={"extends": "/dev/zero"})
    with pytest.raises(RecordError, match="a recorded spec is whole and extends no file"):
        read_manifest(committed)
    assert verify(committed) != []


def test_a_manifest_names_no_video_outside(committed):
    camera = {"file": "../x.mp4", "frames": 1, "fps": 25.0, "width": 4, "height": 4}
    change(committed, cameras={"front": camera})
    with pytest.raises(RecordError, match=r"the video of camera front, '\.\./x\.mp4', is not among the files"):
        read_manifest(committed)


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000, '{"format": 3}', "\xff"])
def test_a_manifest_that_is_none(committed, text):
    (committed / "manifest.json").write_text(text, encoding="latin-1")
    with pytest.raises(RecordError, match=r"manifest\.json (is not JSON|has the format)"):
        read_manifest(committed)


def test_a_manifest_of_unreasonable_size_is_not_read(committed):
    with (committed / "manifest.json").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(RecordError, match="the limit of a JSON file is 16,777,216 bytes"):
        read_manifest(committed)


def test_a_directory_without_trajectories(tmp_path):
    with pytest.raises(RecordError, match="holds no trajectories"):
        verify_run(tmp_path)
    (fault,) = verify(tmp_path)
    assert "manifest.json cannot be read: No such file" in fault
