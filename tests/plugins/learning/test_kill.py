"""Trainings whose process is killed (`kill -9`) go on to the same curve. `make test-learning` runs these."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from anysim.testing.engines import require_engine

pytest.importorskip("torch", reason="the learners need torch: make test-learning")
pytestmark = pytest.mark.full

STEPS, EXAMS = 192, 6
WORDS = ["reach", "-n", "4", "--steps", str(STEPS), "--exams", str(EXAMS), "-e", "mujoco", "-o", "task.horizon=20"]
OPTIONS = ["--option", "n_steps=8", "--option", "width=16", "--no-video"]

KILLED = """
import os, signal, sys
from pathlib import Path

def die():
    os.kill(os.getpid(), signal.SIGKILL)

def dying(function, call, after):
    calls = []
    def wrapped(*arguments, **options):
        calls.append(0)
        if len(calls) == call and not after:
            die()
        told = function(*arguments, **options)
        if len(calls) == call:
            die()
        return told
    return wrapped

moment, policy = sys.argv.pop(1), int(sys.argv.pop(1))
from anysim_learning import checkpoint, export, train
from anysim_learning.batch import Batch

if moment == "in a stretch":
    Batch.step = dying(Batch.step, 19, False)
elif moment == "in an exam":
    from anysim_learning import exam
    exam._acted = dying(exam._acted, 45, False)
elif moment == "before the policy":
    export.export = dying(export.export, policy, False)
elif moment == "before the curve":
    train.write_whole = dying(train.write_whole, 4, False)
elif moment == "before the checkpoint":
    checkpoint.save = dying(checkpoint.save, 3, False)
elif moment == "in the checkpoint":
    write = checkpoint.write_whole
    kept = []
    def half(directory, texts):
        kept.append(0)
        if len(kept) == 3:
            (directory / ".checkpoint.npz.1").write_bytes(next(iter(texts.values()))[:1000])
            die()
        write(directory, texts)
    checkpoint.write_whole = half
elif moment == "after the checkpoint":
    checkpoint.save = dying(checkpoint.save, 3, True)

from anysim.cli.main import main
sys.argv[0] = "anysim"
main()
"""


def trained(out: Path, learner: str, moment: str = "", policy: int = 1) -> int:
    """Run the command in a process of its own; its exit code. `policy` is how many are written when it is killed."""
    words = ["train", *WORDS, "--learner", learner, *OPTIONS, "--out", str(out)]
    program = [sys.executable, "-c", KILLED, moment, str(policy), *words]
    told = subprocess.run(
        program, capture_output=True, text=True, timeout=300, env={**os.environ, "OMP_NUM_THREADS": "1"}
    )
    assert told.returncode in (0, -signal.SIGKILL), told.stderr
    return told.returncode


def curve(out: Path) -> list[dict[str, Any]]:
    """The exams, without the processor time, which is another one each time."""
    rows = [json.loads(line) for line in (out / "curve.jsonl").read_text("utf-8").splitlines()]
    return [{key: value for key, value in row.items() if key != "cpu_s"} for row in rows]


def checkpoint_steps(out: Path) -> int:
    """How far the last whole checkpoint is."""
    from anysim_learning import checkpoint

    if not (out / "checkpoint.npz").exists():
        return 0
    return int(checkpoint.load(out / "checkpoint.npz")["steps"])


def improvements(out: Path) -> list[int]:
    """The exams, from 0, after which a policy was written: those that no earlier one surpasses."""
    marks = [(row["exam"], row["exam_reward"]) for row in curve(out)]
    return [number for number, mark in enumerate(marks) if mark >= max(marks[: number + 1])]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """What learners learnt undisturbed."""
    require_engine("mujoco")

    @cache
    def of(learner: str) -> Path:
        out = tmp_path_factory.mktemp("whole") / learner
        assert trained(out, learner) == 0
        assert [row["steps"] for row in curve(out)] == [32, 64, 96, 128, 160, 192]
        return out

    return of


MOMENTS = {
    "in a stretch": 2,
    "in an exam": 2,
    "before the policy": None,  # the last that is written: after as many checkpoints as there were exams before
    "before the curve": 2,
    "before the checkpoint": 2,
    "in the checkpoint": 2,
    "after the checkpoint": 3,
}
"""What was being done, and how many checkpoints were whole by then."""
CASES = [*(("rsl-rl", moment) for moment in MOMENTS), ("sb3-ppo", "in a stretch"), ("sb3-ppo", "before the checkpoint")]


@pytest.mark.parametrize(("learner", "moment"), CASES)
def test_a_killed_training_goes_on_to_the_same_curve(
    learner: str, moment: str, whole: Callable[[str], Path], tmp_path: Path
) -> None:
    undisturbed, out = whole(learner), tmp_path / learner
    better = improvements(undisturbed)
    assert trained(out, learner, moment, len(better)) == -signal.SIGKILL
    whole_ones = MOMENTS[moment]
    assert checkpoint_steps(out) == 32 * (better[-1] if whole_ones is None else whole_ones), (
        "at most an interval is lost"
    )
    assert trained(out, learner) == 0
    assert curve(out) == curve(undisturbed)
    assert (out / "policy.onnx").read_bytes() == (undisturbed / "policy.onnx").read_bytes()


def test_a_training_that_is_killed_again_and_again_comes_to_its_end(
    whole: Callable[[str], Path], tmp_path: Path
) -> None:
    out, killed = tmp_path / "rsl-rl", 0
    while trained(out, "rsl-rl", "after the checkpoint") != 0:
        killed += 1
        assert checkpoint_steps(out) == 96 * killed
    assert killed == 2
    assert curve(out) == curve(whole("rsl-rl"))
