"""Question sets of recorded episodes: JSON lines beside images, one line for each question that was verified."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image

from anysim.conventions import Array
from anysim.errors import CapabilityError, PluginError, RecordError
from anysim.record.film import capture_of
from anysim.record.replay import begin, rebuild
from anysim_language.episode import Episode, recorded
from anysim_language.questions.all import chosen, verified
from anysim_language.questions.question import Question

QUESTIONS_FILE = "questions.jsonl"
IMAGES = "images"
Wrong = tuple[Path, Question]


class QuestionSet(NamedTuple):
    """What was written.

    Attributes:
        questions: how many, by family.
        images: how many.
        wrong: those that the checker did not agree with; they were left out.
        unseen: why there are no images of a trajectory, by its directory.
    """

    questions: Mapping[str, int]
    images: int
    wrong: tuple[Wrong, ...]
    unseen: Mapping[Path, str]


def write_questions(
    trajectories: Sequence[Path],
    out: Path,
    *,
    moments: int = 4,
    most: int = 60,
    seed: int = 0,
    images: bool = True,
    base: Path | None = None,
    told: Callable[[Path, int], object] = lambda path, count: None,
) -> QuestionSet:
    """Ask about recorded episodes, and write what was verified to `out`: QUESTIONS_FILE, and pictures in IMAGES.

    Args:
        trajectories: directories of committed ones.
        out: a directory; files of an earlier call are replaced.
        moments: control steps of each episode that are asked about, the first and the last one among them.
        most: questions of an episode, evenly over the families.
        seed: chooses questions and phrasings.
        images: whether pictures are wanted: those of the recorded cameras, else drawn from the recorded states.
        base: the folder of the recorded file, where its world has assets with relative paths.
        told: called after each trajectory with the number of its questions.
    """
    out.mkdir(parents=True, exist_ok=True)
    counts: dict[str, int] = {}
    wrong: list[Wrong] = []
    unseen: dict[Path, str] = {}
    pictures = 0
    with (out / QUESTIONS_FILE).open("w", encoding="utf-8") as file:
        for path in trajectories:
            episode = recorded(path, base)
            steps = steps_of(len(episode.body_pose), moments)
            found = list(verified(episode, steps, seed))
            wrong += [(path, one.question) for one in found if not one.agreed]
            asked = chosen([one.question for one in found if one.agreed], most, seed)
            asked.sort(key=lambda question: question.step)
            name = f"{path.resolve().parent.parent.name}-{path.resolve().name}"
            shown: dict[tuple[str, int], str] = {}
            if images:
                try:
                    shown = _pictures(episode, path, sorted({q.step for q in asked}), out, name, base)
                except (CapabilityError, PluginError, RecordError, OSError) as error:
                    unseen[path] = str(error)
            pictures += len(shown)
            for k, question in enumerate(asked):
                row = _row(f"{name}-{k:03d}", path, question, shown)
                file.write(json.dumps(row, ensure_ascii=False, sort_keys=True) + "\n")
                counts[question.family] = counts.get(question.family, 0) + 1
            told(path, len(asked))
    return QuestionSet(counts, pictures, tuple(wrong), unseen)


def steps_of(count: int, moments: int) -> list[int]:
    """The first and the last of `count` steps, and others between them at even distances."""
    return sorted({round(k * (count - 1) / max(moments - 1, 1)) for k in range(moments)})


def _row(name: str, path: Path, question: Question, shown: Mapping[tuple[str, int], str]) -> dict[str, Any]:
    """One line of the file; a question about a camera has that camera's picture alone."""
    camera = question.program.get("camera")
    pictures = {c: file for (c, step), file in shown.items() if step == question.step and camera in (None, c)}
    return {
        "id": name,
        "trajectory": str(path),
        "step": question.step,
        "family": question.family,
        "question": question.text,
        "answer": question.answer,
        "images": pictures,
        "program": dict(question.program),
        "refers": dict(question.refers),
    }


def _pictures(
    episode: Episode, path: Path, steps: Sequence[int], out: Path, name: str, base: Path | None
) -> dict[tuple[str, int], str]:
    """Pictures of these steps by (camera, step): from the videos where they have them, else drawn."""
    assert episode.reader is not None
    manifest = episode.reader.manifest
    found: dict[tuple[str, int], str] = {}
    for camera in sorted(manifest.cameras):
        for step, image in episode.reader.images(camera):
            if step in steps:
                found[camera, step] = _save(image, out, f"{name}-{camera}-{step:05d}.png")
    cameras = sorted(manifest.cameras) or [view.name for view in episode.views]
    missing = [(camera, step) for camera in cameras for step in steps if (camera, step) not in found]
    if missing:
        with rebuild(manifest, base=base) as env:
            if [body.name for body in env.engine.world.bodies] != [body.name for body in episode.world.bodies]:
                raise RecordError(f"the world of {path} has other bodies now, and cannot be drawn from its poses")
            begin(env, manifest)
            for camera, step in missing:
                image = capture_of(env).image_then(camera, 0, step, episode.body_pose[step])
                found[camera, step] = _save(image, out, f"{name}-{camera}-{step:05d}.png")
    return dict(sorted(found.items()))


def _save(image: Array, out: Path, name: str) -> str:
    (out / IMAGES).mkdir(exist_ok=True)
    Image.fromarray(image).save(out / IMAGES / name)
    return f"{IMAGES}/{name}"
