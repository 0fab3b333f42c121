"""Filming of episodes: live, in each step, or from the recorded body poses of an episode that has ended.

An env in which an episode began, and in which nothing that is seen was changed since, gives the pixels that a camera
gave then: colours, textures, lights, lenses and noise are those of the reset, and the rest follows from the poses. It
need not stand where the episode stood, and it is not stepped.
"""

from collections.abc import Sequence
from typing import Literal

from anysim import registry
from anysim.conventions import Array
from anysim.errors import RecordError, SpecError, SpecIssue
from anysim.managers.camera import CaptureManager
from anysim.record.columns import EpisodeColumns
from anysim.record.header import CameraInfo, camera_info
from anysim.record.writer import TrajectoryWriter
from anysim.task.contract import UNSEEN
from anysim.task.env import TaskEnv
from anysim.task.term_registry import find, goes_on
from anysim_schemas.run import RunSpec

FilmMode = Literal["live", "success"]


def film_mode(spec: RunSpec) -> FilmMode:
    """When the videos of a run are drawn: `live`, in each step, or `success`, when an episode has ended and is kept.

    Raises:
        SpecError: at `record.film`: `success` is asked for, and why what is seen cannot be drawn afterwards.
    """
    if spec.record.film == "live":
        return "live"
    reasons = hindrances(spec)
    if spec.record.film == "success":
        if not reasons:
            return "success"
        text = f"episodes cannot be filmed when they have ended: {'; '.join(reasons)}. Use film: live, or auto"
        raise SpecError([SpecIssue("", "record.film", text)])
    observed = spec.task is not None and not set(spec.record.cameras).isdisjoint(spec.task.images)
    return "live" if reasons or observed else "success"  # what is observed is drawn in each step anyway


def hindrances(spec: RunSpec) -> list[str]:
    """Why the images of an episode cannot be drawn from its recorded states, a reason each; empty if they can.

    Recorded are poses of bodies; colours, textures, lights, lenses and what is there follow from the episode's seed, as
    they are drawn at its reset. What changes them in the middle of an episode is not recorded.
    """
    reasons = [
        f"the event '{name}' acts at each step, and its term '{event.term}' is not marked as one that changes nothing "
        "that is seen (anysim.task.contract.changes_nothing_seen)"
        for name, event in (spec.task.events if spec.task is not None else {}).items()
        if (event.when == "step" or goes_on("event", event) is not None)
        and not getattr(find("event", event.term), UNSEEN, False)
    ]
    for name, term in (spec.task.command if spec.task is not None else {}).items():
        if goes_on("command", term) == 7:
            reasons.append(f"the goal '{name}' moves, and where it was is not recorded")
    for name, family in (spec.world.families or {}).items():
        if getattr(registry.load("families", family.kind), "drawn", False):
            reasons.append(f"where the matter of the family '{name}' was is not in the poses of bodies")
    writer: type[TrajectoryWriter] = registry.load("writers", spec.record.writer)
    if spec.record.cameras and writer.open_images is TrajectoryWriter.open_images:
        reasons.append(f"the writer '{spec.record.writer}' writes no images")
    return reasons


def camera_of(env: TaskEnv, index: int, camera: str) -> CameraInfo:
    """A camera of an env as a trajectory describes it: with the mount and the lens of the present episode."""
    engine = env.engine
    found = engine.world.cameras[engine.index.camera(camera)]
    pose, fov = engine.camera_mounts(camera, [index])[0], float(engine.camera_fov(camera, [index])[0])
    return camera_info(engine.world, found, capture_of(env).every, pose, fov)


def draw_recorded(
    env: TaskEnv, index: int, since: int, columns: EpisodeColumns, step: int, cameras: Sequence[str]
) -> dict[str, Array]:
    """Images (H, W, 3) uint8 of cameras at a control step of an episode that has ended.

    Args:
        env: has begun the episode in the env `index`, and no other one since.
        index: the env.
        since: what `engine.appearance_changes[index]` was right after the reset, to be sure that it is still.
        columns: of the whole episode.
        step: a control step of it.
        cameras: of the env's world.

    Raises:
        RecordError: what is seen was changed after the reset.
    """
    refuse_changed(env, index, since)
    poses = columns.state["body_pose"][step - columns.first_step]
    return {camera: capture_of(env).image_then(camera, index, step, poses) for camera in cameras}


def refuse_changed(env: TaskEnv, index: int, since: int) -> None:
    """Raise RecordError where what is seen in an env was changed after `appearance_changes` was `since`."""
    if int(env.engine.appearance_changes[index]) != since:
        raise RecordError(
            f"env {index} cannot be filmed: its colours, lights, cameras or what is there were changed after the "
            "reset, which is not recorded; record with `record.film: live`, without record.channels and annotations"
        )


def capture_of(env: TaskEnv) -> CaptureManager:
    """What takes an env's images.

    Raises:
        RecordError: the env has none.
    """
    if env.capture is None:
        raise RecordError("an env without a CaptureManager takes no images; make it with `anysim.make`")
    return env.capture
