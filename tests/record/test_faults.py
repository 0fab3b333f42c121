"""A disk that fails at every stage of the protocol: nothing partial is visible, nothing is left, the next one works."""

import errno
import itertools
import os
from pathlib import Path

import pytest

from anysim.errors import RecordError
from anysim.record import commit as protocol
from anysim.record.header import EpisodeHeader
from anysim.record.manifest import read_manifest
from anysim.record.recorder import Recorder

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
    "append": lambda patch, writer: patch.setattr(writer, "fail_at", "append"),
    "finish": lambda patch, writer: patch.setattr(writer, "fail_at", "finish"),
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
        recorder.commit(5, "success")
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


def test_an_error_of_another_kind_discards_too(tmp_path, writer, run_header, make_frame, monkeypatch):
    with Recorder(tmp_path, writer, run_header) as recorder:
        recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=1))
        monkeypatch.setattr(writer, "append", lambda self, frame: 1 // 0)
        with pytest.raises(ZeroDivisionError):
            recorder.append(0, make_frame(1))
        assert recorder.open_envs == ()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.json"]


def test_a_disk_that_is_full_from_the_start(tmp_path, writer, run_header, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", failing(os.fsync))
        with pytest.raises(RecordError, match="cannot record into"):
            Recorder(tmp_path / "run", writer, run_header)
    assert list((tmp_path / "run").iterdir()) == []
    Recorder(tmp_path / "run", writer, run_header).close()


def test_a_writer_cannot_place_files_elsewhere(tmp_path, writer, run_header, record, monkeypatch):
    from anysim.record.writer import WrittenFile

    finish = writer.finish
    monkeypatch.setattr(writer, "finish", lambda self, status: (*finish(self, status), WrittenFile("../run.json")))
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
    def begin(self, directory, header):
        raise OSError(number, os.strerror(number), str(directory))

    monkeypatch.setattr(writer, "begin", begin)
    with Recorder(tmp_path, writer, run_header) as recorder, pytest.raises(RecordError, match=remedy):
        record(recorder)
