"""An open episode: how far it is, the words that changed in it, and whether the next frame fits."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError, listing
from anysim.record.columns import ACTION, REWARD, TIME, Change, ColumnStore, EpisodeColumns, Field, fields_of, where
from anysim.record.frame import FrameBatch, RecordedFrame
from anysim.record.header import Header, StateLayout
from anysim.record.json import plain

Film = Callable[[EpisodeColumns, int, Sequence[str]], Mapping[str, Array]]
"""Draws images (H, W, 3) uint8 of an ended episode, by its columns, a control step and the cameras due at it."""


class OpenEpisode:
    """An episode whose numbers are in a slot of the column store, and whose words are here.

    Attributes:
        film: draws its images when it has ended; None where they come with its frames.
        count: frames so far.
        first_step: the control step of the first one.
        first_image: the control step of the first image of each camera.
    """

    def __init__(self, header: Header, slot: int, film: Film | None = None) -> None:
        self.header, self.slot = header, slot
        self.film = film if header.episode.cameras else None
        self.count = self.first_step = 0
        self.first_image: dict[str, int] = {}
        self._status: list[Change] = []
        self._annotations: list[Change] = []
        self._language: list[Change] = []
        self._words = header.episode.instruction
        self._said: Mapping[str, Any] = {}

    @property
    def where(self) -> str:
        """`env 3, episode 2`, for messages."""
        return where(self.header)

    def cameras_due(self, step: int) -> tuple[str, ...]:
        """The cameras whose images belong to a control step."""
        return tuple(name for name, camera in self.header.episode.cameras.items() if step % camera.every == 0)

    def check(self, step: int, images: Mapping[str, Array]) -> None:
        """See that a frame comes in its turn, with the images that are due.

        Raises:
            RecordError: it does not.
        """
        following = self.first_step + self.count
        if step != following and not (self.count == 0 and step == 1):
            expected = str(following) if self.count else "0 or 1"
            raise RecordError(f"{self.where}: frame of step {step}, but step {expected} is next")
        due = self.cameras_due(step) if self.header.episode.cameras and self.film is None else ()
        if images or due:
            self.check_images(step, images, due)

    def check_images(self, step: int, images: Mapping[str, Array], due: Sequence[str]) -> None:
        """See that these are the images of the cameras that are due.

        Raises:
            RecordError: they are not.
        """
        cameras = self.header.episode.cameras
        if set(images) != set(due):
            raise RecordError(f"{self.where}, step {step}: images of {listing(images)}; due are {listing(due)}")
        for name in due:
            camera, image = cameras[name], images[name]
            if image.shape != (camera.height, camera.width, 3) or image.dtype != np.uint8:
                raise RecordError(
                    f"{self.where}, step {step}: the image of camera '{name}' has shape {image.shape} of "
                    f"{image.dtype}; ({camera.height}, {camera.width}, 3) of uint8 expected"
                )

    def note(
        self, step: int, status: str, annotations: Mapping[str, Any], language: str, images: Mapping[str, Array]
    ) -> None:
        """Count a checked frame, and keep of its words what changed."""
        row = self.count
        if row == 0:
            self.first_step = step
        if not self._status or status != self._status[-1].value:
            self._status.append(Change(row, status))
        if not _equal(annotations, self._said):
            words = plain(annotations, "annotations")
            if words != self._said:
                self._said = words
                self._annotations.append(Change(row, words))
        if language and language != self._words:
            self._words = language
            self._language.append(Change(row, language))
        self.note_images(step, images)
        self.count += 1

    def note_images(self, step: int, images: Mapping[str, Array]) -> None:
        """Keep which control step a camera's first image is of."""
        for name in images:
            self.first_image.setdefault(name, step)

    def columns(self, store: ColumnStore) -> EpisodeColumns:
        """The episode as it is now, copied out of the store."""
        arrays = store.take(self.slot, self.count)
        action = arrays[ACTION]
        if self.first_step == 0:
            action[:1] = 0.0
        return EpisodeColumns(
            header=self.header,
            first_step=self.first_step,
            time=arrays[TIME],
            action=action,
            reward=arrays[REWARD],
            state={name: rows for (kind, name), rows in arrays.items() if kind == "state"},
            obs={name: rows for (kind, name), rows in arrays.items() if kind == "obs"},
            status=tuple(self._status),
            annotations=tuple(self._annotations),
            language=tuple(self._language),
            first_image=dict(self.first_image),
        )


def batch_of(episode: OpenEpisode, frame: RecordedFrame) -> FrameBatch:
    """A single frame as a batch of one.

    Raises:
        RecordError: it has an action at step 0, or none at another step.
    """
    if (frame.action is None) != (frame.step == 0):
        raise RecordError(f"{episode.where}, step {frame.step}: step 0 has no action (None), every other step has one")
    width = len(episode.header.run.layout.action)
    action = np.zeros(width) if frame.action is None else np.asarray(frame.action)
    return FrameBatch(
        step=[frame.step],
        time=np.array([frame.time], dtype=float),
        action=action[None],
        state={name: np.asarray(rows)[None] for name, rows in frame.state.items()},
        reward=np.array([frame.reward], dtype=float),
        status=[frame.status],
        obs={name: np.asarray(rows)[None] for name, rows in frame.obs.items()},
        annotations=[frame.annotations],
        language=[frame.language],
        images=[frame.images],
    )


class BatchChecks:
    """Whether the arrays of a batch are those of the layout."""

    def __init__(self, layout: StateLayout) -> None:
        self._fields = fields_of(layout)
        self._state, self._obs = sorted(layout.state), sorted(layout.obs)

    def values(self, episodes: Sequence[OpenEpisode], batch: FrameBatch) -> dict[Field, Array]:
        """The arrays of a batch by field.

        Raises:
            RecordError: names, shapes or types are not those of the layout.
        """
        obs = {name: rows for name, rows in batch.obs.items() if not name.startswith("images/")}
        given: dict[Field, Array] = {TIME: batch.time, REWARD: batch.reward, ACTION: batch.action}
        for kind, names, arrays in (("state", self._state, batch.state), ("obs", self._obs, obs)):
            if sorted(arrays) != names:
                raise RecordError(
                    f"{episodes[0].where}, step {batch.step[0]}: {kind} has {listing(sorted(arrays))}; "
                    f"the layout says {listing(names)}"
                )
            given |= {(kind, name): rows for name, rows in arrays.items()}
        for field, (shape, dtype) in self._fields.items():
            rows = given[field]
            if rows.shape != (len(episodes), *shape) or not (rows.dtype == dtype or np.can_cast(rows.dtype, dtype)):
                raise RecordError(
                    f"{episodes[0].where}, step {batch.step[0]}: {'.'.join(filter(None, field))} has shape "
                    f"{rows.shape[1:]} of {rows.dtype}; the layout says {shape} of {dtype}"
                )
        return given


def _equal(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Whether two mappings surely hold the same; arrays among their values are compared as plain data later."""
    try:
        return bool(a == b)
    except ValueError:
        return False
