"""Checks of a world state, which may come from a file or a program of any origin."""

from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.engine.control import MODES
from anysim.engine.parameters import PARAMETERS
from anysim.engine.snapshots.row_checks import refuse_rotations
from anysim.errors import SnapshotError

if TYPE_CHECKING:
    from anysim.engine.snapshots.world_state import WorldState

_ROWS = {
    "entities": {"present": ()},
    "bodies": {"body_pose": (7,), "body_twist": (6,)},
    "joints": {"joint_pos": (), "joint_vel": ()},
    "actuators": {"control_position": (), "control_velocity": (), "control_effort": (), "control_mode": ()},
    "cameras": {"camera_pose": (7,)},
}
"""What a world state has of its named things, and the shape of each."""
_KINDS = {"present": "b", "control_mode": "U"}
_NUMBERS = "fiu"
_LAST_TICK = 1 << 53


def refuse_forms(state: "WorldState") -> None:
    """Refuse a state whose names are no words, or whose arrays are none or have other shapes than their names say.

    Raises:
        SnapshotError: what differs first.
    """
    _array("time", state.time, (len(state.time) if isinstance(state.time, np.ndarray) and state.time.ndim else -1,))
    envs = len(state.time)
    for things, arrays in _ROWS.items():
        names = getattr(state, things)
        _names(things, names)
        for name, shape in arrays.items():
            _array(name, getattr(state, name), (envs, len(names), *shape))
    for name, rows in state.parameters.items():
        _names(name, rows.names)
        shape = PARAMETERS[name].shape if name in PARAMETERS else np.shape(rows.values)[2:]
        _array(name, rows.values, (envs, len(rows.names), *shape))


def refuse_values(state: "WorldState", dt: float) -> None:
    """Refuse a state that nothing can be in: what is not finite, rotations of no length, unknown modes, odd times.

    Raises:
        SnapshotError: what is wrong first.
    """
    values = {name: getattr(state, name) for arrays in _ROWS.values() for name in arrays}
    values |= {"time": state.time} | {name: rows.values for name, rows in state.parameters.items()}
    for name, array in values.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise _wrong(f"{name} holds a value that is not finite")
    for name in ("body_pose", "camera_pose"):
        refuse_rotations(name, values[name][..., 3:])
    odd = sorted(set(state.control_mode.reshape(-1).tolist()) - {str(mode) for mode in MODES})
    if odd:
        raise _wrong(f"control_mode holds {odd[0]!r}; there are {', '.join(map(str, MODES))}")
    if state.time.size and not 0.0 <= state.time.min() <= state.time.max() <= _LAST_TICK * dt:
        raise _wrong(f"time goes from {state.time.min():g} to {state.time.max():g} s, which is no time since a reset")


def _names(what: str, names: Any) -> None:
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise _wrong(f"{what} should be names")
    if len(set(names)) != len(names):
        raise _wrong(f"{what} names one thing twice")


def _array(name: str, array: Any, shape: tuple[int, ...]) -> None:
    if not isinstance(array, np.ndarray):
        raise _wrong(f"{name} should be an array, and is a {type(array).__name__}")
    if array.dtype.kind not in _KINDS.get(name, _NUMBERS) and array.size:
        raise _wrong(f"{name} holds {array.dtype}")
    if array.shape != shape and (array.size or 0 not in shape):
        raise _wrong(f"{name} has shape {array.shape}, not {shape}")


def _wrong(found: str) -> SnapshotError:
    return SnapshotError(f"the world state cannot be used: its {found}; nothing was changed. Make it anew")
