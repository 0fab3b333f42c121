import json
import os
import shutil
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from anysim.errors import RecordError
from anysim.record.frame import state_digest
from anysim.record.header import CameraInfo, EpisodeHeader
from anysim.record.manifest import read_manifest, read_run
from anysim_recording.recorder import Recorder


def episode(env=0, number=0, **more):
    return EpisodeHeader(env=env, episode=number, episode_seed=1, **more)


def entries(path: Path) -> list[str]:
    return sorted(str(p.relative_to(path)) for p in path.rglob("*"))


def test_a_committed_trajectory_is_the_only_thing_left(tmp_path, writer, run_header, record):
    with Recorder(tmp_path / "run", writer, run_header) as recorder:
        final = record(recorder, env=3, episode=2)
    assert final == tmp_path / "run/episodes/env_0003_episode_0002"
    name = "episodes/env_0003_episode_0002"
    assert entries(tmp_path / "run") == [
        "episodes",
        name,
        f"{name}/actions.txt",
        f"{name}/manifest.json",
        f"{name}/states.txt",
        "run.json",
    ]


def test_the_manifest_says_what_was_recorded(tmp_path, writer, run_header, record, make_frame):
    noon = datetime(2030, 1, 1, 12, tzinfo=UTC)
    with Recorder(tmp_path, writer, run_header, now=lambda: noon) as recorder:
        manifest = read_manifest(record(recorder, env=1, episode=4, steps=3))
    assert (manifest.env, manifest.episode, manifest.steps, manifest.status) == (1, 4, 3, "success")
    assert (manifest.task, manifest.engine, manifest.writer) == ("push", "null", "lines")
    assert manifest.drawn == {"mass": 0.5}
    assert manifest.has_initial_frame
    assert manifest.initial_digest == state_digest(make_frame(0).state)
    assert manifest.final_digest == state_digest(make_frame(3).state)
    assert manifest.spec == {"seed": 7, "limits": ["inf", 1.5]}
    assert manifest.clock["created_at"] == noon.isoformat()
    assert manifest.header().run == recorder.run
    assert read_run(tmp_path).layout == run_header.layout


def test_two_runs_give_the_same_manifest_but_for_the_clock(tmp_path, writer, run_header, record):
    texts = []
    for name in ("one", "two"):
        with Recorder(tmp_path / name, writer, run_header) as recorder:
            data = json.loads((record(recorder) / "manifest.json").read_text())
        assert data.pop("clock")
        texts.append(json.dumps(data))
    assert texts[0] == texts[1]
    assert (tmp_path / "one/run.json").read_bytes() == (tmp_path / "two/run.json").read_bytes()


def test_envs_are_recorded_side_by_side_and_discarded_alone(tmp_path, writer, run_header, make_frame):
    with Recorder(tmp_path, writer, run_header) as recorder:
        for env in (0, 1, 2):
            recorder.start(episode(env))
        for step in (1, 2):
            for env in (0, 1, 2):
                recorder.append(env, make_frame(step))
        recorder.discard(1)
        recorder.discard(1)
        assert recorder.open_envs == (0, 2)
        recorder.commit(2, "success")
        recorder.commit(0, "failed")
        recorder.flush()
        assert recorder.committed() == {(0, 0), (2, 0)}
    assert not read_manifest(tmp_path / "episodes/env_0002_episode_0000").has_initial_frame


def test_close_discards_what_is_open(tmp_path, writer, run_header, make_frame):
    recorder = Recorder(tmp_path, writer, run_header)
    recorder.start(episode())
    recorder.append(0, make_frame(0))
    recorder.close()
    recorder.close()
    assert entries(tmp_path) == ["run.json"]
    with pytest.raises(RecordError, match="is closed; make another one"):
        recorder.start(episode())


def test_a_committed_trajectory_is_never_overwritten(tmp_path, writer, run_header, record):
    with Recorder(tmp_path, writer, run_header) as recorder:
        before = (record(recorder) / "states.txt").read_bytes()
    with Recorder(tmp_path, writer, run_header) as recorder:
        assert recorder.committed() == {(0, 0)}
        with pytest.raises(RecordError, match=r"env_0000_episode_0000 is committed already and is never overwritten"):
            recorder.start(episode())
        record(recorder, episode=1)
    assert (tmp_path / "episodes/env_0000_episode_0000/states.txt").read_bytes() == before


def test_another_run_in_the_directory_is_refused(tmp_path, writer, run_header):
    Recorder(tmp_path, writer, run_header).close()
    with pytest.raises(RecordError, match="trajectories of another run: engine, seed differ from"):
        Recorder(tmp_path, writer, run_header.model_copy(update={"seed": 8, "engine": "other"}))
    assert entries(tmp_path) == ["run.json"]


def test_two_recorders_share_a_run(tmp_path, writer, run_header, record, make_frame):
    with Recorder(tmp_path, writer, run_header) as first:
        first.start(episode(0, 5))
        first.append(0, make_frame(1))
        with Recorder(tmp_path, writer, run_header) as second:
            assert second.swept == ()
            record(second, env=0, episode=5)  # the same trajectory, and faster
            record(second, env=1)
        first.append(0, make_frame(2))
        with pytest.raises(RecordError, match="is committed already"):
            first.commit(0, "success").wait()
        record(first, env=2)
        assert first.committed() == {(0, 5), (1, 0), (2, 0)}
    assert read_manifest(tmp_path / "episodes/env_0000_episode_0005").steps == 3
    assert not (tmp_path / ".incoming").exists()


def test_orphans_are_swept_and_the_living_are_not(tmp_path, writer, run_header, make_frame):
    with Recorder(tmp_path, writer, run_header) as living:
        living.start(episode(0, cameras={"front": CameraInfo(width=4, height=3, every=2)}))
        living.append(0, make_frame(1))
        living.flush()
        incoming = tmp_path / ".incoming"
        # a dead process with our own number, as in a container that was started again; one without a lock; a stranger
        for name in (f"env_0001_episode_0000.{os.getpid()}-1", "env_0002_episode_0000.77777-0", "notes"):
            (incoming / name).mkdir()
            (incoming / name / "trajectory.mcap").write_bytes(b"half")
        (incoming / f"{os.getpid()}-1.lock").touch()
        with Recorder(tmp_path, writer, run_header) as second:
            assert second.swept == (f"env_0001_episode_0000.{os.getpid()}-1", "env_0002_episode_0000.77777-0")
        assert sorted(p.name for p in incoming.iterdir()) == [
            f"{os.getpid()}-0.lock",
            f"env_0000_episode_0000.{os.getpid()}-0",
            "notes",
        ]
        living.commit(0, "success").wait()
    assert living.committed() == {(0, 0)}


def test_resuming_lists_only_names_of_trajectories(tmp_path, writer, run_header, record):
    with Recorder(tmp_path, writer, run_header) as recorder:
        record(recorder, env=12, episode=34567)
        (tmp_path / "episodes/env_1_episode_2").mkdir()
        (tmp_path / "episodes/notes.txt").write_text("mine")
        assert recorder.committed() == {(12, 34567)}


def test_misuse_is_explained(tmp_path, writer, run_header, make_frame):
    with Recorder(tmp_path, writer, run_header) as recorder:
        with pytest.raises(
            RecordError, match=r"no trajectory of env 4 is being written \(open: none\); call start\(\)"
        ):
            recorder.append(4, make_frame(0))
        recorder.start(episode(4))
        with pytest.raises(RecordError, match=r"env 4 has a trajectory open \(env 4, episode 0\); commit or discard"):
            recorder.start(episode(4, 1))
        with pytest.raises(RecordError, match="has no steps; append frames before committing"):
            recorder.commit(4, "success")
        assert recorder.open_envs == ()
        with pytest.raises(RecordError, match=r"drawn\.thing is a object, which JSON cannot hold"):
            recorder.start(episode(4, drawn={"thing": object()}))
    assert entries(tmp_path) == ["run.json"]


def test_a_directory_that_cannot_be_made_is_explained(tmp_path, writer, run_header):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordError, match=r"cannot record into .*file/run: .*/file is a file, not a directory"):
        Recorder(tmp_path / "file/run", writer, run_header)


def test_arrays_may_be_reused_by_the_caller(tmp_path, writer, run_header, make_frame):
    first, second = make_frame(1), make_frame(2)
    buffer = {name: array.copy() for name, array in first.state.items()}
    with Recorder(tmp_path, writer, run_header) as recorder:
        recorder.start(episode())
        recorder.append(0, first._replace(state=buffer))
        for name, array in buffer.items():
            array[...] = second.state[name]
        recorder.append(0, second._replace(state=buffer))
        for array in buffer.values():
            array[...] = 0.0
        manifest = read_manifest(recorder.commit(0, "success").wait())
    assert manifest.final_digest == state_digest(second.state)
    lines = (tmp_path / "episodes/env_0000_episode_0000/states.txt").read_text().splitlines()
    assert lines == [str(frame.state["joint_pos"].tolist()) for frame in (first, second)]


def test_a_moved_trajectory_stays_readable(tmp_path, writer, run_header, record):
    with Recorder(tmp_path / "run", writer, run_header) as recorder:
        final = record(recorder)
    moved = shutil.move(final, tmp_path / "elsewhere")
    manifest = read_manifest(Path(moved))
    assert manifest.layout.joints == ("a", "b")
    assert np.isfinite(manifest.control_dt)
