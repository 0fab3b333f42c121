"""Processes that die and disks that are full, for real."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from anysim.record.recorder import Recorder
from anysim.record.verify import verify_run
from anysim.record.writer import writer_factory

SAMPLE = str(Path(__file__).with_name("conftest.py"))
PRELUDE = """
import importlib.util, os, sys
spec = importlib.util.spec_from_file_location("sample", sys.argv[1])
sample = sys.modules["sample"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(sample)
from pathlib import Path
from anysim.errors import RecordError
from anysim.record.recorder import Recorder
from anysim.record.verify import verify_run
from anysim.record.writer import writer_factory
out = Path(sys.argv[2])
"""

ENDLESS = (
    PRELUDE
    + """
with Recorder(out, writer_factory("mcap", {"chunk_size": 1024}), sample.RUN) as recorder:
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
        recorder.commit(0, "success")
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
    assert orphans or delay
    with Recorder(tmp_path, writer_factory("mcap", {}), sample.RUN) as recorder:
        assert set(recorder.swept) == orphans
        number = max(number for _, number in recorder.committed()) + 1
        recorder.start(sample.episode(0, number))
        for step in range(4):
            recorder.append(0, sample.frame(step))
        recorder.commit(0, "success")
    assert not any(verify_run(tmp_path).values())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["episodes", "run.json"]


def test_a_living_process_is_not_swept(tmp_path, sample):
    process = run(ENDLESS, tmp_path)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        with Recorder(tmp_path, writer_factory("mcap", {}), sample.RUN) as recorder:
            assert recorder.swept == ()
            recorder.start(sample.episode(7, 0))
            for step in range(4):
                recorder.append(7, sample.frame(step))
            recorder.commit(7, "success")
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
    recorder.commit(0, "success")
options = {"chunk_size": 1024 if sys.argv[3] == "early" else 1 << 24}
with Recorder(out, writer_factory("mcap", options), sample.RUN) as recorder:
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
    mount = tmp_path / "disk"
    mount.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", str(mount)]
    if os.geteuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("mounting a small tmpfs needs privileges that this user does not have")
    try:
        check(run(BALLAST + FULL, mount / "run", where), "No space left on device")
    finally:
        subprocess.run(["umount", str(mount)], check=True)
