"""Deferred filming: the images of an episode, drawn from the body poses that were recorded of it.

An env in which the episode began, and in which nothing that is seen was changed since, gives the pixels that a camera
gave then: colours, textures, lights, lenses and noise are those of the reset, and the rest follows from the poses. It
need not stand where the episode stood, and it is not stepped.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.managers.camera import CaptureManager
from anysim.record.header import CameraInfo, camera_info
from anysim.record.manifest import CameraEntry
from anysim.record.writer import TrajectoryWriter
from anysim.task.env import TaskEnv


class Moments(NamedTuple):
    """Columns of an episode.

    Attributes:
        steps: (K,) control steps, in order; step 0 is right after the reset.
        body_pose: (K, B, 7) float64, as `State.body_pose` had them, bodies in the order of the env's world.
    """

    steps: Array
    body_pose: Array


def camera_of(env: TaskEnv, index: int, camera: str) -> CameraInfo:
    """A camera of an env as a trajectory describes it: with the mount and the lens of the present episode."""
    engine = env.engine
    found = engine.world.cameras[engine.index.camera(camera)]
    pose, fov = engine.camera_mounts(camera, [index])[0], float(engine.camera_fov(camera, [index])[0])
    return camera_info(engine.world, found, _capture(env).every, pose, fov)


def images(env: TaskEnv, index: int, camera: str, moments: Moments) -> Iterator[tuple[int, Array]]:
    """(control step, (H, W, 3) uint8) of each step at which images of an env are recorded."""
    capture = _capture(env)
    for step, poses in zip(moments.steps.tolist(), moments.body_pose, strict=True):
        if step % capture.every == 0:
            yield step, capture.image_then(camera, index, step, poses)


def film_episode(
    env: TaskEnv,
    index: int,
    moments: Moments,
    cameras: Sequence[str],
    directory: Path,
    writer: TrajectoryWriter,
    since: int | None = None,
) -> dict[str, CameraEntry]:
    """Write a video of each camera into a directory: the files that a recording of the live images would have.

    Args:
        env: has begun the episode in the env `index`.
        moments: of the whole episode.
        cameras: of the env's world.
        directory: where no such videos are yet. Incomplete ones are left in it where anything is raised.
        writer: the codec is that of its options; nothing else of it is used.
        since: what `engine.appearance_changes[index]` was right after the reset, to be sure that it is still.

    Returns:
        What a manifest says of them; a camera that took no image makes no file.

    Raises:
        RecordError: what is seen was changed after the reset, or the writer has no videos.
    """
    if since is not None and int(env.engine.appearance_changes[index]) != since:
        raise RecordError(
            f"env {index} cannot be filmed: its colours, lights, cameras or what is there were changed after the "
            "reset, which is not recorded; record with `record.film: live`"
        )
    dt = env.engine.world.physics.control_dt
    found: dict[str, CameraEntry] = {}
    for camera in cameras:
        info, file = camera_of(env, index, camera), writer.video_file(camera)
        due = moments.steps[moments.steps % info.every == 0]
        if not len(due):
            continue
        video = writer.open_video(directory / file, info, dt)
        try:
            for _, image in images(env, index, camera, moments):
                video.write(image)
            video.close()
        except BaseException:
            video.abort()
            raise
        found[camera] = CameraEntry(
            **dict(info), file=file, frames=video.frames, first_step=int(due[0]), fps=1.0 / (dt * info.every)
        )
    return found


def moments_for(env: TaskEnv, bodies: Sequence[str], steps: Array, body_pose: Array) -> Moments:
    """Recorded poses (K, R, 7) of bodies by name as moments of an env, whose world may have others too.

    Bodies that were not recorded stand where they are now; recorded ones that the world does not have are left out.
    """
    names = [body.name for body in env.engine.world.bodies]
    if names == list(bodies):
        return Moments(steps, body_pose)
    rows = np.repeat(env.engine.get_state().body_pose[:1], len(steps), axis=0)
    pairs = [(names.index(name), place) for place, name in enumerate(bodies) if name in names]
    for here, there in pairs:
        rows[:, here] = body_pose[:, there]
    return Moments(steps, rows)


def _capture(env: TaskEnv) -> CaptureManager:
    if env.capture is None:
        raise RecordError("an env without a CaptureManager takes no images; make it with `anysim.make`")
    return env.capture
