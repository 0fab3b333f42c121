"""The rules of tests/conftest.py hold: a test that leaves something behind fails, and the user's cache is not used."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

CONFTEST = Path(__file__).parents[1] / "conftest.py"


def outcome(folder: Path, test: str, *options: str) -> str:
    """What pytest prints about one test in a repository that has our conftest."""
    (folder / "tests").mkdir()
    shutil.copy(CONFTEST, folder / "tests")
    (folder / "tests" / "test_it.py").write_text(test, "utf-8")
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--rootdir", str(folder), *options, "tests"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120).stdout


@pytest.mark.parametrize(
    ("test", "complaint"),
    [
        ("def test():\n    open('MUJOCO_LOG.TXT', 'w').close()\n", "the test left MUJOCO_LOG.TXT"),
        (
            "import threading, time\ndef test():\n"
            "    threading.Thread(target=time.sleep, args=(2,), name='busy').start()\n",
            "threads that no test stopped: busy",
        ),
        (
            "import multiprocessing, time\ndef test():\n"
            "    multiprocessing.get_context('spawn').Process(target=time.sleep, args=(2,), name='worker').start()\n",
            "processes that no test stopped: worker",
        ),
    ],
)
def test_what_a_test_leaves_behind_is_an_error(tmp_path: Path, test: str, complaint: str) -> None:
    said = outcome(tmp_path, test)
    assert "1 error" in said
    assert complaint in said


def test_an_environment_that_is_made_meanwhile_belongs_to_no_test(tmp_path: Path) -> None:
    assert "1 passed" in outcome(tmp_path, "import os\ndef test():\n    os.mkdir('.venv-other')\n")


def test_one_worker_runs_all_tests_of_a_group(tmp_path: Path) -> None:
    """What a group shares is set up once. Versions of pytest and pytest-xdist that do not fit say nothing about it."""
    test = """
import pytest

RUN = []

@pytest.mark.parametrize("number", range(8))
@pytest.mark.xdist_group("together")
def test(number):
    RUN.append(number)
    assert RUN == list(range(number + 1))
"""
    assert "8 passed" in outcome(tmp_path, test, "-n", "2", "--dist", "loadgroup")


def test_the_cache_of_the_tests_is_not_the_users(tmp_path: Path) -> None:
    test = """
import os
from pathlib import Path

def test():
    assert Path(os.environ["ANYSIM_CACHE_DIR"]) == Path(__file__).parents[1] / ".cache" / "tests"
"""
    assert "1 passed" in outcome(tmp_path, test)
