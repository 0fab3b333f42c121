"""The video of a training's best policy: the first episode of its exams, drawn as `anysim evaluate --videos` does."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from anysim.api import make
from anysim.errors import AnysimError
from anysim_evaluation.driver import SPLITS
from anysim_evaluation.policy import make_policy
from anysim_evaluation.videos import FOLDER, film

_NAME = "best"


class Video(NamedTuple):
    """Where a video is, from the directory of its training; or, where there is none, why."""

    path: str
    missing: str


def film_best(task: str, engine: str, overrides: Sequence[str], policy: Path, privileged: bool) -> Video:
    """Film the policy of a file in a new env, beside it; an older video of the training is replaced."""
    out = policy.parent
    (out / FOLDER / f"{_NAME}.webp").unlink(missing_ok=True)
    try:
        with make(task, engine=engine, num_envs=1, overrides=overrides) as env:
            wanted = {_NAME: SPLITS["validation"][0]}
            paths = film(env, make_policy(env, str(policy)), wanted, out, privileged=privileged)
    except AnysimError as error:
        return Video("", str(error))
    return Video(paths[0], "") if paths else Video("", f"{engine} draws no images")
