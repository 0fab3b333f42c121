"""Exports that are killed at six or twelve moments and go on to the same bytes, and disks that are full."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.plugins.export.runs import record
from tests.small_disk import small_disk

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("export")]
FORMS = (
    *(pytest.param(form, marks=pytest.mark.full) for form in ("coco", "foxglove")),
    *("lerobot", "rlds-ready", "robomimic", "webdataset"),
)
OPTIONS = {"coco": {"every": 5}, "lerobot": {"channels": True}, "rlds-ready": {"states": True}}

PRELUDE = """
import importlib, json, os, signal, sys
from pathlib import Path
from anysim import registry
from anysim.errors import RecordError
from anysim_export.job import export
run, form, folder = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
options, moments = json.loads(sys.argv[4]), int(sys.argv[5])
for module in registry.load("exporters", form).needs:
    importlib.import_module(module)
def content(directory):
    return {str(p.relative_to(directory)): p.read_bytes() for p in sorted(directory.rglob("*")) if p.is_file()}
def written(out):
    return export([run], form, out, options, failed_too=True)
"""
KILLED = (
    PRELUDE
    + """
def steps_of(out, die_at):
    steps, own = 0, ("anysim_export", "record/commit")
    def step():
        nonlocal steps
        steps += 1
        if steps == die_at:
            os.kill(os.getpid(), signal.SIGKILL)
    def called(frame, event, argument):  # each call that code of exports makes, and each return
        if any(name in frame.f_code.co_filename for name in own):
            step()
    def audited(event, arguments):
        if event in ("open", "os.mkdir", "os.rename", "os.remove", "os.link") and str(out.name) in str(arguments[0]):
            step()
    if die_at is None:
        pass
    elif form in ("coco", "foxglove"):  # an engine built under a profile takes minutes; Python writes what is written
        sys.addaudithook(audited)
    else:
        sys.setprofile(called)
    done = written(out)
    sys.setprofile(None)
    return [steps, done.resumed]
def child(out, die_at):
    reading, writing = os.pipe()
    number = os.fork()  # each of its own, for what draws cannot be forked
    if number == 0:
        os.write(writing, json.dumps(steps_of(out, die_at)).encode())
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])
    os.close(writing)
    with os.fdopen(reading) as said:
        return code, said.read()
code, said = child(folder / "whole", -1)
assert code == 0, code
total = json.loads(said)[0]
wanted, found = content(folder / "whole"), []
for moment in sorted({1 + round(i * (total - 2) / (moments - 1)) for i in range(moments)}):
    out = folder / f"killed_{moment}"
    code, _ = child(out, moment)
    assert code == -signal.SIGKILL, (moment, code)
    aside = out.with_name(f".{out.name}.export")
    begun = (aside / "whole").exists()
    there = out.exists()
    code, said = child(out, None)
    assert code == 0, (moment, code)
    assert content(out) == wanted, moment
    assert not aside.exists()
    found.append([json.loads(said)[1], begun, there])
print(json.dumps(found))
"""
)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short episodes, two cameras, one of which sees depth and segmentation."""
    return record(tmp_path_factory.mktemp("recorded") / "run", 3, "task.horizon=15", "record.keep=all")


def program(text: str, run: Path, form: str, folder: Path, moments: int = 10) -> subprocess.CompletedProcess[str]:
    """Run it."""
    words = [sys.executable, "-c", text, str(run), form, str(folder), json.dumps(OPTIONS.get(form, {})), str(moments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=580, check=False)


@pytest.mark.parametrize("moments", [6, pytest.param(12, marks=pytest.mark.full)])
@pytest.mark.parametrize("form", FORMS)
def test_killed_at_some_moments_it_goes_on_to_the_same_bytes(
    short: Path, tmp_path: Path, form: str, moments: int
) -> None:
    done = program(KILLED, short, form, tmp_path, moments)
    assert done.returncode == 0, done.stderr[-2000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert len(found) == moments
    assert found[0][0] == 0
    assert len({resumed for resumed, _, there in found if not there}) >= moments // 4  # it died in several episodes
    assert (
        moments < 12 or any(begun for _, begun, _ in found) or form in ("webdataset", "coco", "foxglove")
    )  # and while they were put together


# At each of ten sizes that are less than what it takes, the export fails somewhere else.
FULL = (
    PRELUDE
    + """
written(folder.parent / "whole")
wanted = content(folder.parent / "whole")
largest, total = max(map(len, wanted.values())), sum(map(len, wanted.values()))
failed, sentences = 0, set()
for moment in range(1, moments + 1):
    out = folder / f"full_{moment}"
    restrict(moment, largest, total)
    try:
        written(out)
    except RecordError as error:
        failed += 1
        assert str(error).startswith(f"cannot export into {out}: "), error
        assert "make room, and run the same command again" in str(error), error
        sentences.add(str(error).split(": ", 1)[1].split(" (")[0])
        assert not out.exists(), moment
    finally:
        release()
    written(out)
    assert content(out) == wanted, moment
    assert [path for path in folder.iterdir() if path.name != "ballast"] == [out], list(folder.iterdir())
    import shutil
    shutil.rmtree(out)
print(json.dumps([failed, sorted(sentences)]))
"""
)
LIMITS = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
def restrict(moment, largest, total):
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 + (largest - 2) * moment // 11, resource.RLIM_INFINITY))
def release():
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
"""
BALLAST = """
import os, sys
from pathlib import Path
ballast = Path(sys.argv[3]) / "ballast"
def restrict(moment, largest, total):
    left = os.statvfs(ballast.parent)
    ballast.write_bytes(bytes(left.f_bavail * left.f_frsize - total * moment // 11))
def release():
    ballast.unlink()
"""


@pytest.mark.parametrize("form", FORMS)
def test_files_that_may_not_grow_at_ten_sizes(short: Path, tmp_path: Path, form: str) -> None:
    (tmp_path / "disk").mkdir()
    done = program(LIMITS + FULL, short, form, tmp_path / "disk")
    assert done.returncode == 0, done.stderr[-2000:]
    failed, sentences = json.loads(done.stdout.splitlines()[-1])
    assert failed == 10
    assert all("File too large" in one for one in sentences), sentences


@pytest.mark.parametrize("form", FORMS)
def test_a_disk_that_is_full_at_ten_sizes(short: Path, tmp_path: Path, form: str) -> None:
    with small_disk(tmp_path, 16) as mount:
        done = program(BALLAST + FULL, short, form, mount)
        assert done.returncode == 0, done.stderr[-2000:]
        failed, sentences = json.loads(done.stdout.splitlines()[-1])
    assert failed >= 8
    assert all("No space left on device" in one for one in sentences), sentences
