"""Videos of episodes of an evaluation: run once more in an env of their own, and drawn on the way."""

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

from anysim.conventions import Array
from anysim.engine.capability import Capability
from anysim.errors import EngineError
from anysim.record.commit import write_whole
from anysim.task.env import TaskEnv
from anysim_evaluation.driver import FAULT, Episode, drive
from anysim_evaluation.policy import Policy

FPS = 12.5
"""Images in a simulated second; the videos play at the speed of the simulation."""
FOLDER = "videos"


def chosen(episodes: Mapping[int, Episode], count: int) -> dict[str, int]:
    """The first successes and the first failures, at most `count` of each: names of videos, and the seeds."""
    valid = [episode for episode in episodes.values() if episode.status != FAULT]
    won = [episode.seed for episode in valid if episode.status == "success"][:count]
    lost = [episode.seed for episode in valid if episode.status != "success"][:count]
    return {f"success-{seed}": seed for seed in won} | {f"failure-{seed}": seed for seed in lost}


def film(env: TaskEnv, policy: Policy, wanted: Mapping[str, int], out: Path, *, privileged: bool) -> list[str]:
    """Write `videos/NAME.webp` of each that is wanted and not there yet, drawn by the world's first camera.

    Args:
        env: one env of the task, as it was evaluated.
        policy: made of it.
        wanted: seeds by the names of their videos.
        out: the folder of the engine's results.
        privileged: as in `drive`.

    Returns:
        The paths of the videos in `out`, none where the engine draws no images.
    """
    if Capability.RENDER_RGB not in env.engine.capabilities:
        return []
    folder = out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for name, seed in wanted.items():
        if not (folder / f"{name}.webp").exists():
            images: list[Array] = []
            with _drawing(env, images):
                for _ in drive(env, policy, [seed], privileged=privileged):
                    pass
            write_whole(folder, {f"{name}.webp": _animation(images)})
    return [f"{FOLDER}/{name}.webp" for name in wanted]


@contextmanager
def _drawing(env: TaskEnv, images: list[Array]) -> Iterator[None]:
    """Draws env 0 before a control step now and then."""
    every = max(1, round(1.0 / (FPS * env.engine.world.physics.control_dt)))
    inner = env.step

    def step(*arguments: Any, **options: Any) -> Any:
        if int(env.scene.elapsed[0]) % every == 0:
            images.append(env.render(env_ids=[0])[0])
        return inner(*arguments, **options)

    setattr(env, "step", step)  # noqa: B010  on this object alone
    try:
        yield
    finally:
        delattr(env, "step")


def _animation(images: Sequence[Array]) -> bytes:
    if not images:
        raise EngineError("an episode without a step cannot be filmed")
    frames, file = [Image.fromarray(image) for image in images], io.BytesIO()
    frames[0].save(
        file, "WEBP", save_all=True, append_images=frames[1:], duration=round(1000 / FPS), loop=0, quality=60, method=2
    )
    return file.getvalue()
