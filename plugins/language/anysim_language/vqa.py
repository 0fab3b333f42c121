"""Question sets of recorded episodes: JSON lines beside images, one line for each question that was verified.

Each episode's part is written aside and renamed when it is whole, so a call that was cut off goes on where it was.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from errno import EDQUOT, ENOSPC
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from anysim.errors import CapabilityError, PluginError, RecordError
from anysim.record.names import MANIFEST_FILE
from anysim_language.episode import Episode, recorded
from anysim_language.pictures import Shown, pictures
from anysim_language.questions.all import chosen, verified
from anysim_language.questions.forks import Fork, forked
from anysim_language.questions.question import Question
from anysim_language.vocabulary import vocabulary

QUESTIONS_FILE = "questions.jsonl"
PARTS = "parts"


class Wrong(NamedTuple):
    """A question that the checker did not agree with, and that was left out."""

    trajectory: Path
    step: int
    question: str


class QuestionSet(NamedTuple):
    """What was written.

    Attributes:
        questions: how many, by family.
        images: how many.
        wrong: those that the checker did not agree with; they were left out.
        unseen: why there are no images of a trajectory, by its directory.
        unforked: why it was not asked what would be otherwise, likewise.
        resumed: trajectories of which an earlier call had written everything.
    """

    questions: Mapping[str, int]
    images: int
    wrong: tuple[Wrong, ...]
    unseen: Mapping[Path, str]
    unforked: Mapping[Path, str]
    resumed: int


@dataclass(frozen=True)
class QuestionOrder:
    """What is asked for.

    Attributes:
        moments: control steps of each episode that are asked about, the first and the last one among them.
        most: questions of an episode, evenly over the families.
        seed: chooses questions and phrasings.
        images: whether pictures are wanted: those of the recorded cameras, else drawn from the recorded states.
        forks: whether it is asked what would be otherwise, which replays the episode on its engine.
    """

    moments: int = 4
    most: int = 60
    seed: int = 0
    images: bool = True
    forks: bool = True


def write_questions(
    trajectories: Sequence[Path],
    out: Path,
    order: QuestionOrder = QuestionOrder(),
    base: Path | None = None,
    told: Callable[[Path, int], object] = lambda path, count: None,
) -> QuestionSet:
    """Ask about recorded episodes, and write what was verified to `out`: QUESTIONS_FILE, and pictures in `images`.

    Args:
        trajectories: directories of committed ones.
        out: a directory; QUESTIONS_FILE of an earlier call is replaced, its PARTS are used where they are the same.
        order: what is asked.
        base: the folder of the recorded file, where its world has assets with relative paths.
        told: called after each trajectory with the number of its questions.

    Raises:
        RecordError: two trajectories would have one name, or `out` is no directory or cannot be written.
    """
    names: dict[str, Path] = {}
    for path in trajectories:
        name = f"{path.resolve().parent.parent.name}-{path.resolve().name}"
        if names.setdefault(name, path).resolve() != path.resolve():
            raise RecordError(
                f"{path} and {names[name]} are of runs that are called the same, as their questions would be; "
                "rename one of the two runs, or ask about them into two directories"
            )
    if out.exists() and not out.is_dir():
        raise RecordError(f"{out} is no directory; --out is the directory that questions and images are written to")
    with _told(out):
        (out / PARTS).mkdir(parents=True, exist_ok=True)
    parts: dict[Path, dict[str, Any]] = {}
    resumed = 0
    for name, path in names.items():
        key, file = _key(path, order), out / PARTS / f"{name}.json"
        part = _stored(file, key, out)
        resumed += part is not None
        if part is None:
            part = {"key": key, **_part(path, name, out, order, base)}
            with _told(out):
                _write(file, json.dumps(part, ensure_ascii=False, sort_keys=True))
        parts[path] = part
        told(path, len(part["rows"]))
    rows = [{**row, "trajectory": str(path)} for path, part in parts.items() for row in part["rows"]]
    lines = (json.dumps(row, ensure_ascii=False, sort_keys=True) + "\n" for row in rows)
    with _told(out):
        _write(out / QUESTIONS_FILE, "".join(lines))
    return QuestionSet(
        Counter(row["family"] for row in rows),
        sum(len(part["images"]) for part in parts.values()),
        tuple(Wrong(path, step, text) for path, part in parts.items() for step, text in part["wrong"]),
        {path: part["unseen"] for path, part in parts.items() if part["unseen"]},
        {path: part["unforked"] for path, part in parts.items() if part["unforked"]},
        resumed,
    )


def steps_of(count: int, moments: int) -> list[int]:
    """The first and the last of `count` steps, and others between them at even distances."""
    return sorted({round(k * (count - 1) / max(moments - 1, 1)) for k in range(moments)})


def _key(path: Path, order: QuestionOrder) -> str:
    """A digest of all that a part follows from."""
    made_by = [version("anysim-language"), vocabulary().words.to_dict(), repr(order)]
    digest = hashlib.sha256(json.dumps(made_by, sort_keys=True).encode())
    digest.update((path / MANIFEST_FILE).read_bytes())
    return digest.hexdigest()


def _stored(file: Path, key: str, out: Path) -> dict[str, Any] | None:
    """The part that an earlier call wrote, where it is of the same key and its images are there; else None."""
    try:
        part: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    whole = part.get("key") == key and all((out / image).is_file() for image in part["images"])
    return part if whole else None


@contextmanager
def _told(out: Path) -> Generator[None, None, None]:
    """What the file system refuses, as a sentence."""
    try:
        yield
    except OSError as error:
        raise RecordError(
            f"{out} cannot be written: {error.strerror or error}; make room, or give --out a directory that can be "
            "written; what is whole of it is used when the call is made again"
        ) from error


def _write(file: Path, text: str) -> None:
    aside = file.with_name(f".{file.name}.part")
    aside.write_text(text, encoding="utf-8")
    aside.replace(file)


def _part(path: Path, name: str, out: Path, order: QuestionOrder, base: Path | None) -> dict[str, Any]:
    """What is asked about one episode, and its pictures."""
    episode = recorded(path, base)
    steps = steps_of(len(episode.body_pose), order.moments)
    forks, unforked = _forks(episode, steps) if order.forks else ({}, "")
    found = list(verified(episode, steps, order.seed, forks))
    questions = chosen([one.question for one in found if one.agreed], order.most, order.seed)
    questions.sort(key=lambda question: question.step)
    shown: Shown = {}
    unseen = ""
    if order.images:
        try:
            shown = pictures(episode, path, sorted({q.step for q in questions}), out, name)
        except (CapabilityError, PluginError, RecordError, OSError) as error:
            if isinstance(error, OSError) and error.errno in (ENOSPC, EDQUOT):
                with _told(out):
                    raise
            unseen = str(error)
    return {
        "rows": [_row(f"{name}-{k:03d}", question, shown) for k, question in enumerate(questions)],
        "images": sorted(shown.values()),
        "wrong": [(one.question.step, one.question.text) for one in found if not one.agreed],
        "unseen": unseen,
        "unforked": unforked,
    }


def _forks(episode: Episode, steps: Sequence[int]) -> tuple[Mapping[int, Sequence[Fork]], str]:
    """What would be otherwise at these steps, or why that is not known here."""
    try:
        return forked(episode, steps), ""
    except (CapabilityError, PluginError, RecordError) as error:
        return {}, str(error)


def _row(name: str, question: Question, shown: Shown) -> dict[str, Any]:
    """One line of the file; a question about a camera has that camera's picture alone."""
    camera = question.program.get("camera")
    return {
        "id": name,
        "step": question.step,
        "family": question.family,
        "question": question.text,
        "answer": question.answer,
        "images": {c: file for (c, step), file in shown.items() if step == question.step and camera in (None, c)},
        "program": dict(question.program),
        "refers": dict(question.refers),
    }
