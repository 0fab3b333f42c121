"""Processes that die and disks that are full, for real, in a collected run with every stream."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from anysim.task.env import TaskEnv
from anysim_inspect.verify import verify_run
from tests.plugins.mcap.everything import collect, made
from tests.small_disk import small_disk

pytestmark = pytest.mark.slow
EPISODES = 4
MANY = pytest.param(20, marks=pytest.mark.full)
WHOLE = {f"env_000{env}_episode_000{number}": [] for env in (0, 1) for number in (0, 1)}
FILES = {"trajectory.mcap", "camera.mcap", "annotation.mcap", "language.mcap", "front.mp4", "top.mp4"}

# Dies of itself at the n-th step that the files of a run go through; the steps are counted first, without dying.
DYING = """
import itertools, os, signal, sys
from pathlib import Path
from tests.plugins.mcap.everything import collected
out = Path(sys.argv[1])
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
    collected(out, episodes=4)
    if die_at < 0:
        print(next(steps) - 1, flush=True)
def child(out, die_at):
    number = os.fork()  # before any thread was begun
    if number == 0:
        try:
            steps_of(out, die_at)
            os._exit(0)
        finally:
            os._exit(3)
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
if sys.argv[2] == "count":
    assert child(out, -1) == 0
else:
    assert all(child(out / moment, int(moment)) == -signal.SIGKILL for moment in sys.argv[2:])
"""
# Each collection may write less than it needs, and says so; then it may go on.
FULL = """
import os, resource, signal, sys
from pathlib import Path
from anysim.errors import RecordError
from anysim_inspect.verify import verify_run
from tests.plugins.mcap.everything import collect, made
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
out, size, count, failed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), 0
with made() as env:
    collect(env, out / "warm")
    for moment in range(1, count + 1):
        restrict(moment)
        try:
            collect(env, out / str(moment), 4)
        except RecordError as error:
            assert "MiB are free there" in str(error), error
            failed += 1
        finally:
            release()
        there = verify_run(out / str(moment)) if (out / str(moment) / "episodes").is_dir() else {}
        assert not any(there.values()), there
        collect(env, out / str(moment), 4)
        keep(out / str(moment))
print(failed)
"""
LIMITED = """
def restrict(moment):
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 + (size - 2) * moment // count, resource.RLIM_INFINITY))
def release():
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
def keep(run):
    pass
"""
BALLAST = """
import shutil
def restrict(moment):
    left = os.statvfs(out.parent)
    (out.parent / "ballast").write_bytes(bytes(left.f_bavail * left.f_frsize - size * moment // (count + 1)))
def release():
    (out.parent / "ballast").unlink()
def keep(run):
    shutil.move(run, Path(sys.argv[4]) / run.name)
"""


def run(script: str, *arguments: Any) -> str:
    root = Path(__file__).parents[3]
    command = [sys.executable, "-c", script, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, cwd=root)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def assert_whole(out: Path, quiet: Path) -> None:
    """What was begun again is there, byte for byte as in a run without trouble, and nothing else."""
    assert verify_run(out) == WHOLE
    assert contents(out) == contents(quiet)
    assert sorted(p.name for p in out.iterdir()) == ["episodes", "run.json"]


def contents(run: Path) -> dict[str, bytes]:
    """Every file of every trajectory but the manifests, whose clocks differ."""
    episodes = run / "episodes"
    return {str(f.relative_to(episodes)): f.read_bytes() for f in episodes.rglob("*.m*")}


@pytest.fixture(scope="module")
def env() -> Iterator[TaskEnv]:
    """Envs to go on in."""
    with made() as found:
        yield found


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory, env: TaskEnv) -> Path:
    """The run without trouble."""
    out = tmp_path_factory.mktemp("quiet")
    collect(env, out, EPISODES)
    assert {f.name for f in next((out / "episodes").iterdir()).iterdir()} == FILES | {"manifest.json"}
    return out


@pytest.mark.parametrize("count", [8, MANY])
def test_kill_at_many_moments(quiet: Path, env: TaskEnv, tmp_path: Path, count: int) -> None:
    total = int(run(DYING, tmp_path / "counted", "count"))
    moments = sorted({2 + round(i * (total - 8) / (count - 1)) for i in range(count)})
    assert len(moments) == count
    (tmp_path / "killed").mkdir()
    run(DYING, tmp_path / "killed", *moments)
    found, orphans = [], 0
    for moment in moments:
        out = tmp_path / "killed" / str(moment)
        orphans += len(list((out / ".incoming").glob("*/")))
        faults = verify_run(out) if (out / "episodes").is_dir() else {}
        assert not any(faults.values()), (moment, faults)
        found.append(len(faults))
        collect(env, out, EPISODES)
        assert_whole(out, quiet)
    assert found[0] == 0
    assert max(found) >= 2
    assert orphans > 0


@pytest.mark.parametrize("count", [6, MANY])
def test_files_that_may_not_grow_at_many_sizes(quiet: Path, tmp_path: Path, count: int) -> None:
    largest = max(f.stat().st_size for f in quiet.rglob("*") if f.is_file())
    assert int(run(LIMITED + FULL, tmp_path, largest, count)) == count
    for moment in range(1, count + 1):
        assert_whole(tmp_path / str(moment), quiet)


@pytest.mark.parametrize("count", [6, MANY])
def test_a_disk_that_is_full_at_many_sizes(quiet: Path, tmp_path: Path, count: int) -> None:
    total = sum(f.stat().st_size for f in quiet.rglob("*") if f.is_file())
    with small_disk(tmp_path) as mount:
        assert int(run(BALLAST + FULL, mount / "run", total, count, tmp_path)) >= 0.9 * count - 1
    for moment in range(1, count + 1):
        assert_whole(tmp_path / str(moment), quiet)
