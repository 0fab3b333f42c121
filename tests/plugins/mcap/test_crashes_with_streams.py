"""Processes that die and disks that are full, for real, in a collected run with every stream."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from anysim_inspect.verify import verify_run
from tests.plugins.mcap.everything import collected
from tests.plugins.mcap.test_crashes import small_disk

pytestmark = pytest.mark.slow
EPISODES = 4
WHOLE = {f"env_000{env}_episode_000{number}": [] for env in (0, 1) for number in (0, 1)}
FILES = {"trajectory.mcap", "camera.mcap", "annotation.mcap", "language.mcap", "front.mp4", "top.mp4"}

PRELUDE = """
import itertools, os, resource, signal, sys
from pathlib import Path
from anysim.errors import RecordError
from tests.plugins.mcap.everything import collected
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
out, episodes = Path(sys.argv[1]), 4
def child(call, *arguments):
    number = os.fork()
    if number == 0:
        try:
            os._exit(call(*arguments))
        except BaseException as error:
            print(repr(error), file=sys.stderr, flush=True)
            os._exit(3)
    return os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
"""
# Dies of itself at the n-th step that the files of a run go through; the steps are counted first, without dying.
DYING = (
    PRELUDE
    + """
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
    collected(out, episodes=episodes)
    if die_at < 0:
        print(next(steps) - 1, flush=True)
    return 0
if sys.argv[2] == "count":
    assert child(steps_of, out, -1) == 0
else:
    assert all(child(steps_of, out / moment, int(moment)) == -signal.SIGKILL for moment in sys.argv[2:])
"""
)
# Each attempt may write less than it needs, and says so.
FULL = (
    PRELUDE
    + """
def attempt(moment):
    restrict(moment)
    try:
        collected(out / str(moment), episodes=episodes)
    except RecordError as error:
        assert "MiB are free there" in str(error), error
        return 1
    return 0
found = []
for moment in range(1, 21):
    found.append(child(attempt, moment))
    release()
assert set(found) <= {0, 1}, found
print(sum(found))
"""
)
LIMITED = """
largest = int(sys.argv[2])
def restrict(moment):
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 + (largest - 2) * moment // 20, resource.RLIM_INFINITY))
def release():
    pass
"""
BALLAST = """
total, ballast = int(sys.argv[2]), out.parent / "ballast"
def restrict(moment):
    left = os.statvfs(ballast.parent)
    ballast.write_bytes(bytes(left.f_bavail * left.f_frsize - total * moment // 21))
def release():
    ballast.unlink()
    for file in [*out.rglob("*.mp4"), *out.rglob("*.mcap")]:  # the next moments have the same disk
        if "episodes" not in str(file):
            file.unlink()
"""


def run(script: str, *arguments: Any) -> str:
    root = Path(__file__).parents[3]
    command = [sys.executable, "-c", script, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=400, cwd=root)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def contents(run: Path) -> dict[str, bytes]:
    """Every file of every trajectory but the manifests, whose clocks differ."""
    episodes = run / "episodes"
    return {str(f.relative_to(episodes)): f.read_bytes() for f in episodes.rglob("*") if f.name != "manifest.json"}


def resumed(out: Path, whole: dict[str, bytes]) -> int:
    """How many trajectories there were, all of them whole; the rest is collected now, and equal to a quiet run's."""
    faults = verify_run(out) if (out / "episodes").is_dir() else {}
    assert not any(faults.values()), faults
    collected(out, episodes=EPISODES)
    assert verify_run(out) == WHOLE
    assert contents(out) == whole
    assert sorted(p.name for p in out.iterdir()) == ["episodes", "run.json"]
    return len(faults)


@pytest.fixture(scope="module")
def quiet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run without trouble."""
    out = tmp_path_factory.mktemp("quiet")
    collected(out, episodes=EPISODES)
    assert {f.name for f in next((out / "episodes").iterdir()).iterdir()} == FILES | {"manifest.json"}
    return out


def test_kill_at_twenty_moments(quiet: Path, tmp_path: Path) -> None:
    total = int(run(DYING, tmp_path / "counted", "count"))
    moments = sorted({2 + round(i * (total - 8) / 19) for i in range(20)})
    assert len(moments) == 20
    (tmp_path / "killed").mkdir()
    run(DYING, tmp_path / "killed", *moments)
    whole = contents(quiet)
    orphans = [len(list((tmp_path / "killed" / str(moment) / ".incoming").glob("*/"))) for moment in moments]
    found = [resumed(tmp_path / "killed" / str(moment), whole) for moment in moments]
    assert found[0] == 0
    assert max(found) >= 2
    assert max(orphans) > 0


def test_files_that_may_not_grow_at_twenty_sizes(quiet: Path, tmp_path: Path) -> None:
    largest = max(f.stat().st_size for f in quiet.rglob("*") if f.is_file())
    failed = int(run(PRELUDE + LIMITED + FULL.removeprefix(PRELUDE), tmp_path, largest))
    assert failed == 20
    whole = contents(quiet)
    for moment in range(1, 21):
        resumed(tmp_path / str(moment), whole)


def test_a_disk_that_is_full_at_twenty_sizes(quiet: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path) as mount:
        total = sum(f.stat().st_size for f in quiet.rglob("*") if f.is_file())
        failed = int(run(PRELUDE + BALLAST + FULL.removeprefix(PRELUDE), mount / "run", total))
        assert failed >= 18
        for out in sorted((mount / "run").iterdir(), key=lambda path: int(path.name)):
            faults = verify_run(out) if (out / "episodes").is_dir() else {}
            assert not any(faults.values()), faults
