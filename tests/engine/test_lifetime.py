"""Engines that are dropped, or copied by a fork: the first free what they hold, the second say what they are."""

import gc
import subprocess
import sys
import weakref

import numpy as np
import pytest

import anysim
from anysim.engine.factory import runnable
from anysim.engine.lifetime import FEW
from anysim.errors import EngineError
from anysim.task.env import TaskEnv
from anysim.testing.kinematic import NullEngine

FALL = {
    "world": {
        "name": "two_falling",
        "terrain": "none",
        "objects": {"box": {"source": {"box": [0.1, 0.1, 0.1]}}},
        "layout": {"box": {"position": [0.0, 0.0, 1.0]}},
    },
    "task": {"horizon": 50, "observations": {"policy": [{"term": "frame_pose", "frame": "box"}]}},
}
ACTION = np.zeros((2, 0))


def fall(engine: str, shards: int = 1) -> TaskEnv:
    env = anysim.make({**FALL, "engine": {"name": engine, "shards": shards}}, num_envs=2)
    env.reset(seed=0)
    env.step(ACTION)
    return env


@pytest.mark.filterwarnings("ignore:Implicitly cleaning up:ResourceWarning")  # of a temporary folder: rightly so
@pytest.mark.parametrize("engine", runnable())
def test_an_env_that_is_dropped_frees_its_engine(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    freed: list[str] = []
    env = fall(engine)
    kind = type(env.engine)
    monkeypatch.setattr(kind, "_free", lambda self, real=kind._free: (freed.append(engine), real(self))[1])
    gone = weakref.ref(env.engine)
    del env
    gc.collect()
    assert gone() is None
    assert freed == [engine]


MEMORY = """
import ctypes, gc, sys
from anysim.engine import lifetime
from tests.engine.test_lifetime import fall

def used():
    return int(open("/proc/self/statm").read().split()[1]) * 4096 / 2**20

def drop(count):
    for _ in range(count):
        fall(sys.argv[1])
    print(len(lifetime._living))
    gc.collect()  # what waits for the collector, and what malloc keeps, would make the count one of chance
    ctypes.CDLL(None).malloc_trim(0)
    return used()

before = drop(8)
print(drop(12) - before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize(
    "engine",
    [pytest.param(name, marks=pytest.mark.slow) if name in ("pybullet", "sapien") else name for name in runnable()],
)
def test_envs_that_are_dropped_take_no_memory(engine: str) -> None:
    """PyBullet took 42 MiB with each, an env of a larger world more."""
    command = [sys.executable, "-c", MEMORY, engine]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    *waiting, grown = done.stdout.splitlines()[-3:]
    assert max(map(int, waiting)) <= FEW + 1  # for the collector, which this program did not call before
    assert float(grown) < 40.0  # of twelve: less than one


def test_an_engine_whose_construction_failed_is_dropped_in_silence() -> None:
    with pytest.raises(EngineError):
        NullEngine(speed=3)
    gc.collect()  # an error in __del__ would be a warning, which is an error here


@pytest.mark.parametrize(
    ("engine", "shards"),
    [
        *((name, 1) if name == "mujoco" else pytest.param(name, 1, marks=pytest.mark.slow) for name in runnable()),
        ("null", 2),
    ],
)
def test_a_forked_copy_says_at_once_what_it_is(engine: str, shards: int) -> None:
    """And a fork makes envs of its own, ends as programs do, and leaves those of its parent alone."""
    command = [sys.executable, "-m", "tests.engine.forks", engine, str(shards)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    *told, owner, ended, own, ours = done.stdout.splitlines()
    assert len(told) == 5
    for words in told:
        assert words.startswith(f"EngineError: this {engine} engine belongs to process {owner}, and this one is a fork")
        assert "Make envs after the fork" in words
    assert ended == "0"
    assert own == ours


def test_an_engine_without_a_world_goes_with_a_fork() -> None:
    command = [sys.executable, "-m", "tests.engine.forks"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout == "two_falling\n"
