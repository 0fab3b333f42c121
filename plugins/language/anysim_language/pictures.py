"""Pictures of control steps of recorded episodes: from their videos, else drawn from their recorded states."""

from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.record.film import capture_of
from anysim.record.replay import begin, rebuild
from anysim_language.episode import Episode

IMAGES = "images"
Shown = dict[tuple[str, int], str]
"""Files relative to the set, by camera and control step."""


def pictures(episode: Episode, path: Path, steps: Sequence[int], out: Path, name: str) -> Shown:
    """Pictures of these steps by every recorded camera, or by every camera of the world where none was recorded.

    Args:
        episode: recorded, at `path`.
        path: the trajectory.
        steps: control steps.
        out: the directory whose IMAGES they go to.
        name: what their names begin with.

    Raises:
        RecordError: the world has other bodies now.
        CapabilityError, PluginError: nothing here can draw it.
    """
    assert episode.reader is not None
    manifest = episode.reader.manifest
    found: Shown = {}
    for camera in sorted(manifest.cameras):
        for step, image in episode.reader.images(camera):
            if step in steps:
                found[camera, step] = _save(image, out, f"{name}-{camera}-{step:05d}.png")
    cameras = sorted(manifest.cameras) or [view.name for view in episode.views]
    missing = [(camera, step) for camera in cameras for step in steps if (camera, step) not in found]
    if missing:
        with rebuild(manifest, base=episode.base) as env:
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
