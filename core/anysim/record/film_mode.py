"""Live or deferred filming: whether the images of a run follow from what is recorded of it."""

from typing import Literal

from anysim import registry
from anysim.errors import SpecError, SpecIssue
from anysim.record.writer import TrajectoryWriter
from anysim.task.contract import UNSEEN
from anysim.task.term_registry import find
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
        if event.when == "step" and not getattr(find("event", event.term), UNSEEN, False)
    ]
    writer: type[TrajectoryWriter] = registry.load("writers", spec.record.writer)
    if spec.record.cameras and writer.open_video is TrajectoryWriter.open_video:
        reasons.append(f"the writer '{spec.record.writer}' cannot write a video by itself")
    return reasons
