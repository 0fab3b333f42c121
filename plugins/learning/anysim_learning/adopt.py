"""Networks of one training as the beginning of another, which may observe more."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch  # pyright: ignore[reportMissingImports]

from anysim.errors import TaskError
from anysim_learning import checkpoint
from anysim_learning.export import described
from anysim_learning.learner import Learner, Lesson
from anysim_learning.train import CHECKPOINT, POLICY
from anysim_schemas.policy_file import METADATA, PolicyFileSpec

_OWN = ("distribution.", "obs_normalizer.count")
"""What a beginning has of its own: the noise, and how much its normalisation has seen."""


def widened(saved: Mapping[str, Any], made: Mapping[str, Any]) -> dict[str, Any]:
    """Tensors of a network that was made, with what a smaller one has learnt; further inputs have no weight.

    Raises:
        TaskError: more than the number of inputs is another one.
    """
    return {key: new if key.startswith(_OWN) else _widened(key, saved.get(key), new) for key, new in made.items()}


def _widened(key: str, old: Any, new: torch.Tensor) -> torch.Tensor:
    shapes = None if old is None else (tuple(old.shape), tuple(new.shape))
    if shapes is None or shapes[0][:-1] != shapes[1][:-1] or shapes[0][-1:] > shapes[1][-1:]:
        raise TaskError(
            f"'{key}' of the training to begin with is {'absent' if shapes is None else shapes[0]}, and "
            f"{tuple(new.shape)} here; give the same options, such as `--option width=…`"
        )
    wide = torch.zeros_like(new) if key.endswith("weight") else new.clone()
    wide[..., : shapes[0][-1]] = old
    return wide


def begin_with(learner: Learner, lesson: Lesson, folder: Path) -> None:
    """Give a learner the networks of the training in a folder.

    Raises:
        TaskError: the learner cannot take them, there are none, or their observations are not the first of the lesson.
    """
    import onnx  # pyright: ignore[reportMissingImports]

    adopt = getattr(learner, "adopt", None)
    if adopt is None:
        raise TaskError(f"{type(learner).__name__} cannot begin with another training; use `--learner rsl-rl`")
    if missing := [name for name in (POLICY, CHECKPOINT) if not (folder / name).exists()]:
        raise TaskError(f"{folder} has no {missing[0]}; --from takes the directory that `anysim train` wrote")
    notes = {note.key: note.value for note in onnx.load(str(folder / POLICY)).metadata_props}
    before = _terms(PolicyFileSpec.model_validate_json(notes[METADATA]))
    now = _terms(described(lesson.env, lesson.groups))
    if before != now[: len(before)]:
        k = next(k for k, term in enumerate(before) if now[k : k + 1] != [term])
        here = now[k] if k < len(now) else "nothing"
        raise TaskError(
            f"{folder} has learnt from {before[k]} where '{lesson.env.name}' has {here} (observation {k + 1}); "
            "--from needs a task whose first observations are those"
        )
    adopt(checkpoint.load(folder / CHECKPOINT))


def _terms(about: PolicyFileSpec) -> list[dict[str, Any]]:
    """What is observed in order; noise, bias and delay may differ."""
    rows = [term for terms in about.terms.values() for term in terms]
    return [{key: value for key, value in term.items() if key not in ("noise", "bias", "delay")} for term in rows]
