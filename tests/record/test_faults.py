"""A disk that fails at every stage of the protocol: nothing partial is visible, nothing is left, the next one works."""

import errno
import itertools
import os
import threading
from pathlib import Path

import numpy as np
import pytest

from anysim.errors import PluginFailure, RecordError
from anysim.record import commit as protocol
from anysim.record.header import CameraInfo, EpisodeHeader
from anysim.record.manifest import read_manifest
from anysim.record.writer import TrajectoryWriter, WrittenFile
from anysim_recording import committer
from anysim_recording.recorder import Recorder

FULL = OSError(errno.ENOSPC, "No space left on device")


def failing(real, when=lambda *args: True, nth=1):
    """Calls through, except that the n-th call with arguments that `when` accepts fails."""
    calls = itertools.count(1)

    def call(*args, **kwargs):
        if when(*args) and next(calls) == nth:
            raise FULL
        return real(*args, **kwargs)

    return call


def is_rename_into_place(source, target):
    return Path(target).parent.name == "episodes"


FAULTS = {
    "begin": lambda patch, writer: patch.setattr(writer, "fail_at", "begin"),
    "write": lambda patch, writer: patch.setattr(writer, "fail_at", "write"),
    "fsync of the first file": lambda patch, writer: patch.setattr(os, "fsync", failing(os.fsync, nth=1)),
    "fsync of the second file": lambda patch, writer: patch.setattr(os, "fsync", failing(os.fsync, nth=2)),
    "hash": lambda patch, writer: patch.setattr(protocol, "describe", failing(protocol.describe)),
    "fsync of the manifest": lambda patch, writer: patch.setattr(os, "fsync", failing(os.fsync, nth=3)),
    "manifest": lambda patch, writer: patch.setattr(protocol, "write_durably", failing(protocol.write_durably)),
    "fsync of the directory": lambda patch, writer: patch.setattr(os, "fsync", failing(os.fsync, nth=4)),
    "rename": lambda patch, writer: patch.setattr(Path, "rename", failing(Path.rename, is_rename_into_place)),
    "fsync of the parent": lambda patch, writer: patch.setattr(os, "fsync", failing(os.fsync, nth=5)),
}


@pytest.mark.parametrize("stage", FAULTS)
def test_a_full_disk_at(stage, tmp_path, writer, run_header, record, make_frame):
    with Recorder(tmp_path, writer, run_header) as recorder:
        whole = record(recorder, env=0)
        recorder.start(EpisodeHeader(env=5, episode=0, episode_seed=1))
        recorder.append(5, make_frame(1))
        with pytest.MonkeyPatch.context() as patch:
            FAULTS[stage](patch, writer)
            with pytest.raises(RecordError, match="No space left on device") as caught:
                record(recorder, env=1)
        message = str(caught.value)
        assert str(tmp_path) in message
        assert "MiB are free there" in message
        assert "Make room, or record into another directory" in message
        assert recorder.open_envs == (5,)
        assert [p.name for p in (tmp_path / "episodes").iterdir()] == [whole.name]
        assert not list((tmp_path / ".incoming").glob("env_0001*"))
        read_manifest(whole)
        # there is room again: the same one, the interrupted neighbour and further ones go on in this process
        record(recorder, env=1)
        recorder.append(5, make_frame(2))
        recorder.commit(5, "success").wait()
        assert recorder.committed() == {(0, 0), (1, 0), (5, 0)}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["episodes", "run.json"]


def test_the_faults_are_all_reached(tmp_path, writer, run_header, record, monkeypatch):
    """The table above counts calls of fsync: two files, manifest, directory, parent."""
    calls = []
    real = os.fsync
    with Recorder(tmp_path, writer, run_header) as recorder:
        record(recorder, env=0)
        monkeypatch.setattr(os, "fsync", lambda fd: (calls.append(fd), real(fd)))
        record(recorder, env=1)
    assert len(calls) == 5


CAMERAS = {"front": CameraInfo(width=4, height=3), "back": CameraInfo(width=2, height=2, every=2)}


def images(step):
    due = {name: camera for name, camera in CAMERAS.items() if step % camera.every == 0}
    return {name: np.full((camera.height, camera.width, 3), step, np.uint8) for name, camera in due.items()}


@pytest.mark.parametrize("later", [False, True], ids=["live", "later"])
@pytest.mark.parametrize("stage", ["open", "append", "finish"])
def test_a_full_disk_at_an_image(stage, later, tmp_path, writer, run_header, make_frame, monkeypatch):
    """Of an image that comes with its frame, and of one that is drawn when the episode has ended."""

    def draw(columns, step, cameras):
        assert columns.steps == 3
        assert set(cameras) == set(images(step))
        return images(step)

    def film(recorder):
        header = EpisodeHeader(env=0, episode=0, episode_seed=1, cameras=CAMERAS)
        recorder.start(header, draw if later else None)
        for step in range(1, 4):
            recorder.append(0, make_frame(step, images={} if later else images(step)))
            recorder.flush()
        return recorder.commit(0, "success").wait()

    with Recorder(tmp_path, writer, run_header) as recorder:
        with monkeypatch.context() as patch:
            patch.setattr(writer, "fail_at", stage)
            what = {"open": "cannot begin env 0", "append": "cannot write step 1 of env 0", "finish": "cannot commit"}
            with pytest.raises(RecordError, match=f"{what[stage]}.*No space left on device .*Make room"):
                film(recorder)
        assert recorder.open_envs == ()
        recorder.flush()
        assert not [path for path in (tmp_path / ".incoming").iterdir() if path.is_dir()]
        manifest = read_manifest(film(recorder))
    assert {name: (c.frames, c.first_step) for name, c in manifest.cameras.items()} == {"front": (3, 1), "back": (1, 2)}


def test_images_drawn_later_are_those_of_the_cameras_that_are_due(tmp_path, writer, run_header, make_frame):
    """Neither with a frame, nor of another camera, nor of another size."""
    header = EpisodeHeader(env=0, episode=0, episode_seed=1, cameras=CAMERAS)
    with Recorder(tmp_path, writer, run_header) as recorder:
        recorder.start(header, lambda columns, step, cameras: images(step))
        with pytest.raises(RecordError, match="images of front; due are none"):
            recorder.append(0, make_frame(1, images=images(1)))
        large = {**images(2), "back": images(1)["front"]}
        wrong = {"images of front; due are front, back": images(1), "has shape": large}
        for words, drawn in wrong.items():
            recorder.start(header, lambda columns, step, cameras, drawn=drawn: images(1) if step == 1 else drawn)
            for step in (1, 2):
                recorder.append(0, make_frame(step))
            with pytest.raises(RecordError, match=words):
                recorder.commit(0, "success")
            assert recorder.open_envs == ()
        recorder.flush()
        assert not [path for path in (tmp_path / ".incoming").iterdir() if path.is_dir()]


def test_a_writer_without_images_says_so(tmp_path, writer, run_header, make_frame, monkeypatch):
    monkeypatch.setattr(type(writer), "open_images", TrajectoryWriter.open_images)
    with Recorder(tmp_path, writer, run_header) as recorder:
        recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=1, cameras=CAMERAS))
        recorder.flush()
        with pytest.raises(RecordError, match=r"'lines' writes no images of front, back; set record\.cameras"):
            recorder.append(0, make_frame(1, images=images(1)))


def test_an_error_of_another_kind_discards_too(tmp_path, writer, run_header, record, monkeypatch):
    with Recorder(tmp_path, writer, run_header) as recorder:
        monkeypatch.setattr(writer, "write", lambda directory, columns, status: 1 // 0)
        with pytest.raises(PluginFailure, match=r"episode 0: the writer 'lines' of .* failed: ZeroDivisionError"):
            record(recorder)
        assert recorder.open_envs == ()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.json"]


def test_a_failure_that_is_not_waited_for_is_raised_when_the_recorder_closes(tmp_path, writer, run_header, make_frame):
    def record_badly():
        with Recorder(tmp_path, writer, run_header) as recorder:
            for env in range(3):
                recorder.start(EpisodeHeader(env=env, episode=0, episode_seed=1))
                recorder.append(env, make_frame(1))
                recorder.flush()
                writer.fail_at = "write" if env == 1 else ""
                recorder.commit(env, "success")

    with pytest.raises(RecordError, match="cannot commit env 1, episode 0: No space left on device"):
        record_badly()
    assert sorted(p.name for p in (tmp_path / "episodes").iterdir()) == [
        "env_0000_episode_0000",
        "env_0002_episode_0000",
    ]
    assert not (tmp_path / ".incoming").exists()


@pytest.fixture
def held(writer, monkeypatch):
    """Keeps the recorder's thread in its first `write` until the event is set, so that commits gather behind it."""
    event, write = threading.Event(), writer.write

    def wait(directory, columns, status):
        assert event.wait(20)
        return write(directory, columns, status)

    monkeypatch.setattr(writer, "write", wait)
    return event


def commit_together(recorder, make_frame, held, envs):
    for env in envs:
        recorder.start(EpisodeHeader(env=env, episode=0, episode_seed=1))
        recorder.append(env, make_frame(1))
    pending = [recorder.commit(env, "success") for env in envs]
    assert not any(commit.done for commit in pending)
    held.set()
    recorder.flush()
    assert all(commit.done for commit in pending)
    return pending


def test_commits_that_wait_together_share_the_last_fsync(tmp_path, writer, run_header, make_frame, held, monkeypatch):
    calls = []
    real = protocol.fsync
    monkeypatch.setattr(protocol, "fsync", lambda path: (calls.append(path.name), real(path)))
    with Recorder(tmp_path, writer, run_header) as recorder:
        pending = commit_together(recorder, make_frame, held, range(5))
        assert [commit.wait().name for commit in pending] == [f"env_{env:04d}_episode_0000" for env in range(5)]
    assert calls.count("episodes") == 1
    assert calls.count("states.txt") == 5
    assert calls.index("episodes") > max(place for place, name in enumerate(calls) if name.startswith("env_"))


@pytest.mark.parametrize(("nth", "lost"), [(1, {0}), (3, {2}), (5, {4})])
def test_one_rename_of_a_group_that_fails(nth, lost, tmp_path, writer, run_header, make_frame, held, monkeypatch):
    with Recorder(tmp_path, writer, run_header) as recorder:
        monkeypatch.setattr(Path, "rename", failing(Path.rename, is_rename_into_place, nth))
        pending = commit_together(recorder, make_frame, held, range(5))
        for env, commit in enumerate(pending):
            if env in lost:
                with pytest.raises(RecordError, match=f"cannot commit env {env}, episode 0: No space left"):
                    commit.wait()
        assert recorder.committed() == {(env, 0) for env in set(range(5)) - lost}
        assert not [path for path in (tmp_path / ".incoming").iterdir() if path.is_dir()]


def test_a_last_fsync_that_fails_takes_the_whole_group_back(
    tmp_path, writer, run_header, make_frame, held, monkeypatch
):
    real = protocol.fsync
    fails = failing(real, lambda path: path.name == "episodes")
    monkeypatch.setattr(protocol, "fsync", fails)
    with Recorder(tmp_path, writer, run_header) as recorder:
        for commit in commit_together(recorder, make_frame, held, range(3)):
            with pytest.raises(RecordError, match="No space left on device"):
                commit.wait()
        assert recorder.committed() == set()
        for env in range(3):
            recorder.start(EpisodeHeader(env=env, episode=0, episode_seed=1))
            recorder.append(env, make_frame(1))
            recorder.commit(env, "success").wait()
        assert recorder.committed() == {(0, 0), (1, 0), (2, 0)}


def test_a_trajectory_that_is_about_to_be_committed_is_not_begun_again(tmp_path, writer, run_header, make_frame, held):
    with Recorder(tmp_path, writer, run_header) as recorder:
        recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=1))
        recorder.append(0, make_frame(1))
        recorder.commit(0, "success")
        with pytest.raises(RecordError, match="is committed already and is never overwritten"):
            recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=1))
        recorder.start(EpisodeHeader(env=0, episode=1, episode_seed=1))
        held.set()


def test_commits_that_are_faster_than_the_disk_wait(tmp_path, writer, run_header, make_frame, held, monkeypatch):
    monkeypatch.setattr(committer, "QUEUE_BYTES", 3 * committer.SMALLEST)
    with Recorder(tmp_path, writer, run_header) as recorder:
        done = threading.Event()

        def commit_all():
            for env in range(8):
                recorder.start(EpisodeHeader(env=env, episode=0, episode_seed=1))
                recorder.append(env, make_frame(1))
                recorder.commit(env, "success")
            done.set()

        thread = threading.Thread(target=commit_all)
        thread.start()
        assert not done.wait(0.3)  # one is being written, three wait, the fifth does not fit
        held.set()
        thread.join(20)
        assert done.is_set()
        recorder.flush()
        assert len(recorder.committed()) == 8


def test_a_disk_that_is_full_from_the_start(tmp_path, writer, run_header, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", failing(os.fsync))
        with pytest.raises(RecordError, match="cannot record into"):
            Recorder(tmp_path / "run", writer, run_header)
    assert list((tmp_path / "run").iterdir()) == []
    Recorder(tmp_path / "run", writer, run_header).close()


def test_a_writer_cannot_place_files_elsewhere(tmp_path, writer, run_header, record, monkeypatch):
    write = writer.write
    monkeypatch.setattr(writer, "write", lambda *args: (*write(*args), WrittenFile("../run.json")))
    with Recorder(tmp_path, writer, run_header) as recorder:
        with pytest.raises(RecordError, match=r"'\.\./run\.json' cannot be a file of a trajectory"):
            record(recorder)
        assert recorder.committed() == set()


@pytest.mark.parametrize(
    ("number", "remedy"),
    [
        (errno.EMFILE, r"Too many open files .*Allow more open files \(ulimit -n\)"),
        (errno.EROFS, "Read-only file system .*Make the directory writable"),
        (errno.EFBIG, "File too large .*Make room"),
    ],
)
def test_the_remedy_fits_the_trouble(number, remedy, tmp_path, writer, run_header, record, monkeypatch):
    def write(directory, columns, status):
        raise OSError(number, os.strerror(number), str(directory))

    monkeypatch.setattr(writer, "write", write)
    with Recorder(tmp_path, writer, run_header) as recorder, pytest.raises(RecordError, match=remedy):
        record(recorder)
