"""One trajectory on its way to a writer: checks each frame against the header, counts, digests, and passes it on."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError, listing
from anysim.record.frame import Frame, state_digest
from anysim.record.header import Header
from anysim.record.writer import TrajectoryWriter

FLOAT64 = np.dtype(np.float64)
MAX_TIME = 2.0**63 / 1e9
"""Log times are 64-bit nanoseconds."""


class EpisodeSummary(NamedTuple):
    """What the frames amounted to."""

    steps: int
    has_initial_frame: bool
    initial_digest: str | None
    final_digest: str


class Episode:
    """Frames of one env in order. Holds no frame: what comes in has been written when `append` returns."""

    def __init__(self, header: Header, writer: TrajectoryWriter) -> None:
        self.header = header
        self.writer = writer
        layout = header.run.layout
        self._state = [(name, layout.state[name]) for name in sorted(layout.state)]
        self._obs = [(name, layout.obs[name].shape, np.dtype(layout.obs[name].dtype)) for name in sorted(layout.obs)]
        self._action_shape = (len(layout.action),)
        self._step = -1
        self._time = 0.0
        self._initial: str | None = None
        self._last: dict[str, Array] = {}
        self.first_image: dict[str, int] = {}
        """The control step of the first image of each camera."""

    @property
    def where(self) -> str:
        """`env 3, episode 2`, for messages."""
        return f"env {self.header.episode.env}, episode {self.header.episode.episode}"

    def cameras_due(self, step: int) -> tuple[str, ...]:
        """The cameras whose images belong to the frame of a control step."""
        return tuple(name for name, camera in self.header.episode.cameras.items() if step % camera.every == 0)

    def append(self, frame: Frame) -> None:
        """Check a frame and write it.

        Raises:
            RecordError: it does not fit the header, or holds a number that is not finite.
        """
        checked = self._checked(frame)
        self.writer.append(checked)
        if self._step < 0 and checked.step == 0:
            self._initial = state_digest(checked.state)
        for name in checked.images:
            self.first_image.setdefault(name, checked.step)
        self._step, self._time = checked.step, checked.time
        self._last = {name: array.copy() for name, array in checked.state.items()}

    def summary(self) -> EpisodeSummary:
        """What the frames amounted to.

        Raises:
            RecordError: there is no step.
        """
        if self._step < 1:
            raise RecordError(f"the trajectory of {self.where} has no steps; append frames before committing it")
        return EpisodeSummary(self._step, self._initial is not None, self._initial, state_digest(self._last))

    # ------------------------------------------------------------------ checks

    def _checked(self, frame: Frame) -> Frame:
        step = frame.step
        expected = "0 or 1" if self._step < 0 else str(self._step + 1)
        if step != self._step + 1 and not (self._step < 0 and step == 1):
            raise RecordError(f"{self.where}: frame of step {step}, but step {expected} is next")
        if (frame.action is None) != (step == 0):
            raise RecordError(f"{self.where}, step {step}: step 0 has no action (None), every other step has one")
        time = float(frame.time)
        if not self._time <= time < MAX_TIME:
            raise RecordError(f"{self.where}, step {step}: time {time} s; {self._time} s or later expected")
        if not math.isfinite(frame.reward):
            raise RecordError(f"{self.where}, step {step}: the reward is {frame.reward}; a finite number expected")
        self._same_names("state", step, frame.state, self.header.run.layout.state)
        state = {name: self._array(f"state.{name}", step, frame.state[name], shape) for name, shape in self._state}
        action = None
        if frame.action is not None:
            action = self._array("action", step, frame.action, self._action_shape)
        self._finite(step, state if action is None else {**state, "action": action})
        return frame._replace(
            time=time,
            action=action,
            state=state,
            reward=float(frame.reward),
            obs=self._checked_obs(step, frame.obs),
            images=self._checked_images(step, frame.images),
        )

    def _array(self, what: str, step: int, values: Any, shape: tuple[int, ...], dtype: Any = FLOAT64) -> Array:
        array = np.asarray(values)
        if array.shape != shape or not np.can_cast(array.dtype, dtype):
            raise RecordError(
                f"{self.where}, step {step}: {what} has shape {array.shape} of {array.dtype}; "
                f"the layout says {shape} of {dtype}"
            )
        return np.asarray(array, dtype=dtype, order="C")

    def _finite(self, step: int, arrays: Mapping[str, Array]) -> None:
        if not arrays or np.isfinite(np.concatenate([array.reshape(-1) for array in arrays.values()])).all():
            return
        for name, array in arrays.items():
            bad = np.argwhere(~np.isfinite(array))
            if len(bad):
                at = tuple(int(i) for i in bad[0])
                raise RecordError(
                    f"{self.where}, step {step}: {name}{list(at)} is {array[at]}; a trajectory holds finite numbers "
                    "only: discard the trajectory of an env whose state is at fault"
                )

    def _same_names(self, what: str, step: int, given: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
        if given.keys() != wanted.keys():
            raise RecordError(
                f"{self.where}, step {step}: {what} has {listing(sorted(given))}; "
                f"the layout says {listing(sorted(wanted))}"
            )

    def _checked_obs(self, step: int, obs: Mapping[str, Array]) -> dict[str, Array]:
        groups = {name: array for name, array in obs.items() if not name.startswith("images/")}
        self._same_names("obs", step, groups, self.header.run.layout.obs)
        return {name: self._array(f"obs.{name}", step, groups[name], shape, dtype) for name, shape, dtype in self._obs}

    def _checked_images(self, step: int, images: Mapping[str, Array]) -> dict[str, Array]:
        due = self.cameras_due(step)
        if set(images) != set(due):
            raise RecordError(f"{self.where}, step {step}: images of {listing(images)}; due are {listing(due)}")
        for name in due:
            camera, image = self.header.episode.cameras[name], images[name]
            if image.shape != (camera.height, camera.width, 3) or image.dtype != np.uint8:
                raise RecordError(
                    f"{self.where}, step {step}: the image of camera '{name}' has shape {image.shape} of "
                    f"{image.dtype}; ({camera.height}, {camera.width}, 3) of uint8 expected"
                )
        return {name: images[name] for name in due}
