"""What is recorded of one env at one control step."""

import hashlib
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.control import Control
from anysim.engine.state import State
from anysim.errors import RecordError

NOTHING: Mapping[str, Any] = MappingProxyType({})


class Frame(NamedTuple):
    """Control step `step`: the action that was taken, and everything else as it was right after it.

    Step 0, if there is one, is the beginning: no action, the state and observation right after the reset. The others
    follow one by one from 1.

    Attributes:
        step: control step, from 0 or 1.
        time: simulated time since the reset [s].
        action: (A,), or None at step 0.
        state: arrays of one env by the names and shapes of the layout, float64.
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


def state_rows(state: State, env: int, fields: Iterable[str], control: Control | None = None) -> dict[str, Array]:
    """The arrays of one env, by the names of `state_layout`; views, not copies."""
    rows: dict[str, Array] = {}
    for name in fields:
        if not name.startswith("control_"):
            rows[name] = getattr(state, name)[env]
        elif control is not None:
            rows[name] = getattr(control, name.removeprefix("control_"))[env]
        else:
            raise RecordError(f"the layout has '{name}', which is read from the commands; pass control=")
    return rows


def state_digest(state: Mapping[str, Array]) -> str:
    """SHA-256 over names, shapes and the bits of the float64 values, whatever the order of the names."""
    digest = hashlib.sha256(b"anysim-state-1")
    for name in sorted(state):
        values = np.ascontiguousarray(state[name], dtype="<f8")
        digest.update(f"|{name}{values.shape}".encode())
        digest.update(values.tobytes())
    return digest.hexdigest()
