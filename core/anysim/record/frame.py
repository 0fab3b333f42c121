"""Recorded frames: the state, action and words of one env, or of many at once, at one control step."""

import hashlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import Control
from anysim.engine.state import State
from anysim.errors import RecordError

NOTHING: Mapping[str, Any] = MappingProxyType({})


class RecordedFrame(NamedTuple):
    """Control step `step`: the action that was taken, and everything else as it was right after it.

    Step 0, if there is one, is the beginning: no action, the state and observation right after the reset. The others
    follow one by one from 1.

    Attributes:
        step: control step, from 0 or 1.
        time: simulated time since the reset [s].
        action: (A,), or None at step 0.
        state: arrays of one env by the names, shapes and types of the layout.
        reward: of this step.
        status: `running`, `success`, `failed`, `truncated`, as the task says after this step.
        obs: groups of one env, as in the layout; `images/…` are ignored.
        annotations: plain data such as `{"skill": "pick", "phase": "approach"}`; holds until another one comes.
        language: the instruction in force; holds likewise.
        images: (H, W, 3) uint8 of the cameras that are due.
    """

    step: int
    time: float
    action: Array | None
    state: Mapping[str, Array]
    reward: float = 0.0
    status: str = "running"
    obs: Mapping[str, Array] = NOTHING
    annotations: Mapping[str, Any] = NOTHING
    language: str = ""
    images: Mapping[str, Array] = NOTHING


class FrameBatch(NamedTuple):
    """A `RecordedFrame` for each of n envs, its fields with a leading axis; the envs may be at different steps.

    Attributes:
        step, time, reward: (n,).
        action: (n, A); rows at step 0 mean nothing.
        state, obs: arrays (n, …) by name.
        status, annotations, language, images: n of each.
    """

    step: Sequence[int]
    time: Array
    action: Array
    state: Mapping[str, Array]
    reward: Array
    status: Sequence[str]
    obs: Mapping[str, Array]
    annotations: Sequence[Mapping[str, Any]]
    language: Sequence[str]
    images: Sequence[Mapping[str, Array]]


def state_batch(
    state: State, fields: Sequence[str], control: Control | None = None, env_ids: Array | None = None
) -> dict[str, Array]:
    """The arrays (n, …) of these envs (default: all), by the names of `state_layout`; views where they can be.

    Raises:
        RecordError: the fields have a command, and no control is given.
    """
    arrays: dict[str, Array] = {}
    for name in fields:
        if not name.startswith("control_"):
            rows: Array = getattr(state, name)
        elif control is not None:
            rows = getattr(control, name.removeprefix("control_"))
        else:
            raise RecordError(f"the layout has '{name}', which is read from the commands; pass control=")
        arrays[name] = rows if env_ids is None else rows[env_ids]
    return arrays


def state_rows(state: State, env: int, fields: Sequence[str], control: Control | None = None) -> dict[str, Array]:
    """The arrays of one env, by the names of `state_layout`; views, not copies."""
    return {name: rows[env] for name, rows in state_batch(state, fields, control).items()}


def state_digest(state: Mapping[str, Array]) -> str:
    """SHA-256 over names, shapes and the bits of the values as float64, whatever the order of the names."""
    digest = hashlib.sha256(b"anysim-state-1")
    for name in sorted(state):
        values = np.ascontiguousarray(state[name], dtype="<f8")
        digest.update(f"|{name}{values.shape}".encode())
        digest.update(values.tobytes())
    return digest.hexdigest()
