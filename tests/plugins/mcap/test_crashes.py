"""Processes that die and disks that are full, for real."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from anysim.record.writer import make_writer
from anysim_inspect.verify import verify_run
from anysim_recording.recorder import Recorder
from tests.small_disk import small_disk

SAMPLE = str(Path(__file__).with_name("conftest.py"))
PRELUDE = """
import importlib.util, os, sys
spec = importlib.util.spec_from_file_location("sample", sys.argv[1])
sample = sys.modules["sample"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(sample)
from pathlib import Path
from anysim.errors import RecordError
from anysim_recording.recorder import Recorder
from anysim_inspect.verify import verify_run
from anysim.record.writer import make_writer
out = Path(sys.argv[2])
"""

ENDLESS = (
    PRELUDE
    + """
with Recorder(out, make_writer("mcap", {"chunk_size": 1024}), sample.RUN) as recorder:
    for number in range(10_000):
        if (0, number) in recorder.committed():
            continue
        recorder.start(sample.episode(0, number))
        recorder.start(sample.episode(1, number))
        for step in range(31):
            recorder.append(0, sample.frame(step % 9)._replace(step=step, time=step * 0.02,
                action=None if step == 0 else sample.frame(1).action,
                images={n: sample.picture(c.width, c.height, 1)
                        for n, c in sample.CAMERAS.items() if step % c.every == 0}))
            if step == 15:
                print(number, flush=True)
        recorder.commit(0, "success").wait()
        recorder.discard(1)
"""
)


def run(script, *arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-c", script, SAMPLE, *map(str, arguments)], stdout=subprocess.PIPE, text=True, **options
    )


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.01])
def test_kill_in_the_middle_of_a_run(tmp_path, delay, sample):
    process = run(ENDLESS, tmp_path)
    assert process.stdout is not None
    seen = [int(process.stdout.readline()) for _ in range(4)]
    time.sleep(delay)  # later in the trajectory, or in its commit
    process.send_signal(signal.SIGKILL)
    process.communicate()
    faults = verify_run(tmp_path)
    assert len(faults) >= len(seen) - 1  # the last one seen was in its middle
    assert not any(faults.values()), faults
    orphans = {path.name for path in (tmp_path / ".incoming").iterdir() if path.is_dir()}
    with Recorder(tmp_path, make_writer("mcap", {}), sample.RUN) as recorder:
        assert set(recorder.swept) == orphans
        number = max(number for _, number in recorder.committed()) + 1
        recorder.start(sample.episode(0, number))
        for step in range(4):
            recorder.append(0, sample.frame(step))
        recorder.commit(0, "success")
    assert not any(verify_run(tmp_path).values())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["episodes", "run.json"]


# Dies of itself at the n-th step that the files of a run go through; the steps are counted first, without dying.
MOMENTS = (
    PRELUDE
    + """
import itertools, signal
def steps_of(out, die_at):
    steps = itertools.count(1)
    def step(*_):
        if next(steps) == die_at:
            os.kill(os.getpid(), signal.SIGKILL)
    def audit(event, arguments):
        if event in ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir") and str(out) in str(arguments[0]):
            step()
    sys.addaudithook(audit)
    real = os.fsync
    os.fsync = lambda descriptor: (step(), real(descriptor), step())
    with Recorder(out, make_writer("mcap", {"chunk_size": 1024}), sample.RUN) as recorder:
        for number in range(2):
            for env in range(3):
                cameras = sample.CAMERAS if env == 0 else {}
                recorder.start(sample.episode(env, number, cameras))
                for t in range(6):
                    recorder.append(env, sample.frame(t, cameras))
            for env in range(2):
                recorder.commit(env, "success")
            recorder.discard(2)
    os.fsync = real
    return next(steps) - 1
def child(out, die_at):
    number = os.fork()
    if number == 0:
        print(steps_of(out, die_at), flush=True)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
if sys.argv[3] == "count":
    assert child(out, -1) == 0
else:
    assert all(child(out / moment, int(moment)) == -signal.SIGKILL for moment in sys.argv[3:])
"""
)


@pytest.mark.slow
def test_kill_at_twenty_moments_of_a_run(tmp_path, sample):
    """Each file that is opened, each rename and each fsync of the recorder's thread is one; twenty of them all."""
    counting = run(MOMENTS, tmp_path / "whole", "count")
    total = int(counting.communicate(timeout=60)[0])
    assert counting.returncode == 0
    assert total > 60
    moments = sorted({1 + round(i * (total - 4) / 19) for i in range(20)})
    assert len(moments) == 20
    (tmp_path / "killed").mkdir()
    dying = run(MOMENTS, tmp_path / "killed", *moments)
    dying.communicate(timeout=120)
    assert dying.returncode == 0
    found, orphans = [], 0
    for moment in moments:
        out = tmp_path / "killed" / str(moment)
        orphans += len(list((out / ".incoming").glob("*/")))
        faults = verify_run(out) if (out / "episodes").is_dir() else {}
        assert not any(faults.values()), (moment, faults)
        found.append(len(faults))
        with Recorder(out, make_writer("mcap", {}), sample.RUN) as recorder:
            there = recorder.committed()
            assert len(there) == len(faults)
            for env, number in {(env, number) for env in range(2) for number in range(2)} - there:
                recorder.start(sample.episode(env, number, {}))
                for step in range(3):
                    recorder.append(env, sample.frame(step, {}))
                recorder.commit(env, "success")
        assert len(verify_run(out)) == 4
        assert not any(verify_run(out).values())
        assert sorted(p.name for p in out.iterdir()) == ["episodes", "run.json"]
    assert found[0] == 0
    assert orphans > 0
    assert max(found) >= 2  # the moments reach beyond the first commits


def test_a_living_process_is_not_swept(tmp_path, sample):
    process = run(ENDLESS, tmp_path)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        with Recorder(tmp_path, make_writer("mcap", {}), sample.RUN) as recorder:
            assert recorder.swept == ()
            recorder.start(sample.episode(7, 0))
            for step in range(4):
                recorder.append(7, sample.frame(step))
            recorder.commit(7, "success").wait()
        before = int(process.stdout.readline())
        assert int(process.stdout.readline()) == before + 1
    finally:
        process.kill()
        process.communicate()
    assert not any(verify_run(tmp_path).values())


# fails until it may write more, then goes on in the same process
FULL = (
    PRELUDE
    + """
import numpy as np
noise = np.random.default_rng(0)
cameras = sample.CAMERAS if sys.argv[3] == "video" else {}
def attempt(recorder, number, steps):
    recorder.start(sample.episode(0, number, cameras=cameras))
    for step in range(steps + 1):
        frame = sample.frame(1, cameras)
        state = {name: noise.normal(size=value.shape) for name, value in frame.state.items()}
        images = {n: noise.integers(0, 255, (c.height, c.width, 3), dtype=np.uint8)
                  for n, c in cameras.items() if step % c.every == 0}
        recorder.append(0, frame._replace(step=step, time=step * 0.02, state=state, images=images,
                                          action=None if step == 0 else frame.action))
    recorder.commit(0, "success").wait()
options = {"chunk_size": 1024 if sys.argv[3] == "early" else 1 << 24}
with Recorder(out, make_writer("mcap", options), sample.RUN) as recorder:
    attempt(recorder, 0, 5)
    restrict()
    for again in range(2):
        try:
            attempt(recorder, 1, 150)
        except RecordError as error:
            print(error)
        else:
            print("no error")
    assert recorder.open_envs == ()
    recorder.flush()
    assert not [p for p in (out / ".incoming").iterdir() if p.is_dir()], list((out / ".incoming").iterdir())
    assert recorder.committed() == {(0, 0)}
    print(len(os.listdir("/proc/self/fd")))
    release()
    attempt(recorder, 1, 150)
print(verify_run(out))
"""
)

LIMIT = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
def restrict():
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, resource.RLIM_INFINITY))
def release():
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
"""
BALLAST = """
import os, sys
from pathlib import Path
ballast = Path(sys.argv[2]).parent / "ballast"
def restrict():
    free = os.statvfs(ballast.parent).f_bavail * os.statvfs(ballast.parent).f_frsize
    ballast.write_bytes(bytes(free - 60_000))
def release():
    ballast.unlink()
"""


def check(process, message):
    output, _ = process.communicate(timeout=120)
    lines = output.splitlines()
    assert process.returncode == 0, output
    for line in lines[:2]:
        assert message in line
        assert "MiB are free there" in line
        assert "committed trajectories are whole" in line
    assert int(lines[2]) < 32  # descriptors are not leaked
    assert lines[3] == "{'env_0000_episode_0000': [], 'env_0000_episode_0001': []}"


@pytest.mark.parametrize("where", ["early", "late", "video"])
def test_a_file_that_may_not_grow(tmp_path, where):
    """`early`: in a chunk of the MCAP file, `late`: when it is finished, `video`: in a video."""
    check(run(LIMIT + FULL, tmp_path / "run", where), "File too large")
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["episodes", "run.json"]


@pytest.mark.parametrize("where", ["early", "late", "video"])
def test_a_disk_that_is_full(tmp_path, where):
    with small_disk(tmp_path) as mount:
        check(run(BALLAST + FULL, mount / "run", where), "No space left on device")


# at each of twenty sizes the next files fail somewhere else: in a chunk, at the summary, in a video, at the manifest
TWENTY = (
    PRELUDE
    + """
options = {"chunk_size": 1024, "compression": "none"}
def attempt(recorder, number):
    for env, cameras in ((0, sample.CAMERAS), (1, {})):
        recorder.start(sample.episode(env, number, cameras))
        for step in range(9):
            recorder.append(env, sample.frame(step, cameras))
    pending = [recorder.commit(env, "success") for env in (0, 1)]
    recorder.flush()
    for error in [wrong for commit in pending if (wrong := trouble(commit)) is not None]:
        raise error
def trouble(commit):
    try:
        commit.wait()
    except RecordError as error:
        return error
def clean(recorder):
    for env in recorder.open_envs:
        recorder.discard(env)
    recorder.flush()
    assert not [p for p in (out / ".incoming").iterdir() if p.is_dir()], list((out / ".incoming").iterdir())
failed = 0
with Recorder(out, make_writer("mcap", options), sample.RUN) as recorder:
    attempt(recorder, 0)
    largest = max(f.stat().st_size for d in (out / "episodes").iterdir() for f in d.iterdir())
    total = sum(f.stat().st_size for d in (out / "episodes").iterdir() for f in d.iterdir())
    for moment in range(1, 21):
        restrict(moment, largest, total)
        try:
            attempt(recorder, moment)
        except RecordError as error:
            assert "MiB are free there" in str(error), error
            failed += 1
        finally:
            clean(recorder)
            release()
        assert not any(verify_run(out).values())
        for env, number in {(0, moment), (1, moment)} - recorder.committed():
            recorder.start(sample.episode(env, number, {}))
            recorder.append(env, sample.frame(1, {}))
            recorder.commit(env, "success").wait()
assert len(os.listdir("/proc/self/fd")) < 32
print(failed, verify_run(out) == {f"env_000{e}_episode_00{n:02d}": [] for e in (0, 1) for n in range(21)})
"""
)
TWENTY_LIMITS = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
def restrict(moment, largest, total):
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 + (largest - 2) * moment // 20, resource.RLIM_INFINITY))
def release():
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
"""
TWENTY_BALLASTS = """
import os, sys
from pathlib import Path
ballast = Path(sys.argv[2]).parent / "ballast"
def restrict(moment, largest, total):
    left = os.statvfs(ballast.parent)
    ballast.write_bytes(bytes(left.f_bavail * left.f_frsize - total * moment // 21))
def release():
    ballast.unlink()
"""


@pytest.mark.slow
def test_files_that_may_not_grow_at_twenty_sizes(tmp_path):
    output, _ = run(TWENTY_LIMITS + TWENTY, tmp_path / "run").communicate(timeout=120)
    assert output.split() == ["20", "True"]


@pytest.mark.slow
def test_a_disk_that_is_full_at_twenty_sizes(tmp_path):
    with small_disk(tmp_path) as mount:
        output, _ = run(TWENTY_BALLASTS + TWENTY, mount / "run").communicate(timeout=120)
        failed, whole = output.split()
        assert whole == "True"
        assert int(failed) >= 18
