"""The loop of `anysim train`: stretches of learning, exams, curves, checkpoints, and the policy as a file."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from math import inf
from pathlib import Path
from time import process_time
from typing import Any

from anysim.errors import RecordError, TaskError
from anysim.record.commit import write_whole
from anysim.task.env import TaskEnv
from anysim_learning import checkpoint
from anysim_learning.curves import CURVE, PAGE, page
from anysim_learning.learner import Learner, Lesson

POLICY, CHECKPOINT, ABOUT = "policy.onnx", "checkpoint.npz", "train.json"

Tell = Callable[[Mapping[str, float]], None]


def train(
    learner: Learner, lesson: Lesson, examined: TaskEnv, steps: int, exams: int, out: Path, tell: Tell
) -> Mapping[str, float]:
    """Learn until `steps` are done, from the checkpoint in `out` on where there is one; returns the last numbers.

    The policy that is kept is that of the best exam: of those that solve most, that of the greatest reward, and the
    latest of equals. `best` of the numbers is its success, and `cpu_s` the processor time of this process and of those
    before it [s]. All else is the same after an interruption as without one.

    Args:
        learner: that of the lesson.
        lesson: what is learnt from.
        examined: envs of the same task for exams, one episode in each.
        steps: when to end, as the learner counts.
        exams: how many there are on the way; a checkpoint is written after each.
        out: where `policy.onnx`, `checkpoint.npz`, `curve.jsonl`, `curves.html` and TensorBoard's files go.
        tell: is called with the numbers of each stretch, and how many `steps` are done.
    """
    from torch.utils.tensorboard import SummaryWriter  # pyright: ignore[reportMissingImports]

    from anysim_learning.exam import Mark, exam
    from anysim_learning.export import described, export

    rows = [json.loads(line) for line in _lines(out / CURVE)]
    if (out / CHECKPOINT).exists():
        _restore(learner, out / CHECKPOINT)
    rows = [row for row in rows if row["steps"] <= learner.steps]  # what was learnt after it is learnt again
    about = described(lesson.env, lesson.groups, learner.chunk, lesson.images)
    numbers: dict[str, float] = rows[-1] if rows else {}
    spent = numbers.get("cpu_s", 0.0) - process_time()
    with closing(SummaryWriter(str(out / "tensorboard"), purge_step=learner.steps)) as board:
        for goal in _goals(learner.steps, steps, exams):
            while learner.steps < goal:
                numbers = {**learner.advance(), "steps": learner.steps}
                for name, value in numbers.items():
                    board.add_scalar(name, value, learner.steps)
                tell(numbers)
            network = learner.network()
            passed = exam(examined, (*lesson.groups, *lesson.images), network)
            best = max([Mark(row["exam"], row.get("exam_reward", -inf)) for row in rows], default=passed)
            told = {"exam": passed.success, "exam_reward": passed.reward, "best": max(passed, best).success}
            numbers = {**numbers, "steps": learner.steps, **told}
            numbers["cpu_s"] = round(spent + process_time(), 1)
            board.add_scalar("exam", passed.success, learner.steps)
            board.add_scalar("exam_reward", passed.reward, learner.steps)
            tell(numbers)
            rows.append(numbers)
            if passed >= best:
                signed = about.model_copy(update={"seed": lesson.seed, "steps": learner.steps})
                export(network, signed, out / POLICY)
            write_whole(out, {CURVE: "".join(json.dumps(row) + "\n" for row in rows), PAGE: page({out.name: rows})})
            # Last: what a killed process wrote after the checkpoint before is learnt and written again.
            checkpoint.save(out / CHECKPOINT, learner.state())
    return numbers


def describe_training(out: Path, about: Mapping[str, Any]) -> None:
    """Say in `out` what is trained there, or see that it is the same.

    Raises:
        TaskError: it is the directory of another training.
    """
    path = out / ABOUT
    if path.exists():
        before = json.loads(path.read_text("utf-8"))
        other = sorted(key for key in {*before, *about} if before.get(key) != about.get(key))
        if other:
            told = ", ".join(f"{key} {before.get(key)!r} there and {about.get(key)!r} here" for key in other)
            raise TaskError(f"{out} holds another training ({told}); give another --out, or delete it")
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out, {ABOUT: json.dumps(dict(about), indent=2) + "\n"})


def _restore(learner: Learner, path: Path) -> None:
    """Go on from a checkpoint.

    Raises:
        RecordError: it lacks something that this version of the learner keeps.
    """
    state = checkpoint.load(path)
    try:
        learner.restore(state)
    except KeyError as error:
        raise RecordError(
            f"the checkpoint {path} has no {error}: another version wrote it; delete it, and training begins anew"
        ) from None


def _goals(done: int, steps: int, exams: int) -> Iterator[int]:
    """Steps at which there are exams, the last at the end."""
    yield from (goal for n in range(1, exams + 1) if (goal := -(-steps * n // exams)) > done)


def _lines(path: Path) -> list[str]:
    return path.read_text("utf-8").splitlines() if path.exists() else []
