"""What a snapshot holds beside the engine's own rows, and in which order it is put back."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from anysim.conventions import Array
from anysim.engine.parameters import PARAMETERS
from anysim.engine.state import Snapshot, SnapshotLevel

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine

# ruff: noqa: SLF001  the two halves of one mechanism, apart so that each can be read at once


def take(engine: "SimEngine", ids: Array, level: SnapshotLevel) -> Snapshot:
    """Copy the rows of envs; see `SimEngine.snapshot`."""
    data: dict[str, Array] = {"ticks": engine._ticks[ids], "cameras": engine._rig.poses[ids]}
    data |= {f"commands.{name}": rows for name, rows in engine._commands.rows(ids).items()}
    data |= {f"parameter.{name}": engine._get_parameter(name)[ids] for name in engine._changed}
    data |= {f"engine.{name}": rows for name, rows in engine._snapshot(ids, level).items()}
    copies = {name: np.array(rows) for name, rows in data.items()}
    return Snapshot(engine.name, engine.version, engine.world.hash, level, copies)


def put_back(engine: "SimEngine", ids: Array, snapshot: Snapshot) -> None:
    """Write checked rows: parameters first, since an engine's state may depend on them.

    A parameter that was changed since, but not when the snapshot was taken, gets its built value back.
    """
    data = snapshot.data
    engine._retire_state()
    for name in PARAMETERS:
        rows = data.get(f"parameter.{name}")
        if rows is None and name in engine._changed:
            rows = np.repeat(engine._default_parameter(name)[None], len(ids), axis=0)
        if rows is not None:
            engine._set_parameter(name, rows, ids, np.arange(int(rows.shape[1])))
            engine._changed[name] = None
    engine._commands.restore(ids, _under("commands.", data))
    engine._rig.poses[ids] = data["cameras"]
    engine._restore(ids, _under("engine.", data), snapshot.level)
    engine._ticks[ids] = data["ticks"]


def _under(prefix: str, data: Mapping[str, Array]) -> dict[str, Array]:
    """The entries of a snapshot whose names begin with `prefix`, without it."""
    return {name[len(prefix) :]: rows for name, rows in data.items() if name.startswith(prefix)}
