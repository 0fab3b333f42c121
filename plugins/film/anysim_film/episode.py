"""Films of recorded trajectories: their images as they would have been taken, into files of their writer."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.record.film import camera_of, capture_of
from anysim.record.header import Header
from anysim.record.manifest import CameraEntry, Manifest
from anysim.record.writer import TrajectoryWriter
from anysim.task.env import TaskEnv
from anysim_recording.trajectory_files import camera_entries


class Moments(NamedTuple):
    """Columns of an episode.

    Attributes:
        steps: (K,) control steps, in order; step 0 is right after the reset.
        body_pose: (K, B, 7) float64, as `State.body_pose` had them, bodies in the order of the env's world.
    """

    steps: Array
    body_pose: Array


def film_episode(
    env: TaskEnv,
    manifest: Manifest,
    moments: Moments,
    cameras: Sequence[str],
    directory: Path,
    writer: TrajectoryWriter,
) -> dict[str, CameraEntry]:
    """Write a video of each camera into a directory: the files that a recording of the live images would have.

    Args:
        env: has begun the episode in its env 0, and nothing that is seen was changed since.
        manifest: of the recorded trajectory.
        moments: of the whole episode.
        cameras: of the env's world.
        directory: where no such videos are yet. Incomplete ones are left in it where anything is raised.
        writer: used for this alone.

    Returns:
        What a manifest says of them; a camera that took no image makes no file.

    Raises:
        RecordError: the writer takes no images.
    """
    infos = {camera: camera_of(env, 0, camera) for camera in cameras}
    recorded = manifest.header()
    run = recorded.run.model_copy(update={"control_dt": env.engine.world.physics.control_dt})
    header = Header(run, recorded.episode.model_copy(update={"cameras": infos}))
    capture, first = capture_of(env), dict[str, int]()
    writer.prepare(run)
    files = writer.open_images(directory, header)
    try:
        for step, poses in zip(moments.steps.tolist(), moments.body_pose, strict=True):
            due = [camera for camera, info in infos.items() if step % info.every == 0]
            for camera in due:
                first.setdefault(camera, step)
            if due:
                files.append({camera: capture.image_then(camera, 0, step, poses) for camera in due})
        written = files.finish()
    except BaseException:
        files.abort()
        raise
    return camera_entries(header, first, written)


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
