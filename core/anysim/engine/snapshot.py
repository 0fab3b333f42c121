"""What a snapshot holds beside the engine's own rows, in which order it is put back, and how snapshots are joined."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.conventions import Array
from anysim.engine import snapshot_file
from anysim.engine.control import Control
from anysim.engine.parameters import PARAMETERS
from anysim.engine.state import Snapshot, SnapshotLevel
from anysim.errors import SnapshotError

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine

# ruff: noqa: SLF001  the two halves of one mechanism, apart so that each can be read at once


def take(engine: "SimEngine", ids: Array, level: SnapshotLevel) -> Snapshot:
    """Copy the rows of envs; see `SimEngine.snapshot`."""
    data: dict[str, Array] = {
        "ticks": engine._ticks[ids],
        "cameras": engine._rig.poses[ids],
        "fov": engine._rig.fov[ids],
    }
    if engine._presence.varies:
        data["present"] = engine._presence.entities[ids]
    data |= {f"commands.{name}": rows for name, rows in engine._commands.rows(ids).items()}
    data |= {f"parameter.{name}": engine._get_parameter(name)[ids] for name in engine._changed}
    data |= {f"engine.{name}": rows for name, rows in engine._snapshot(ids, level).items()}
    copies = {name: np.array(rows) for name, rows in data.items()}
    return Snapshot(engine.name, engine.version, engine.world.hash, level, copies)


def refuse_foreign(engine: "SimEngine", snapshot: Snapshot) -> None:
    """Refuse data that this engine did not make, before anything is changed.

    Raises:
        SnapshotError: rows are missing, have other shapes, or are in a form that the engine no longer reads.
    """
    data, world = snapshot.data, engine.world
    drives, cameras = (len(world.actuators),), (len(world.cameras), 7)
    shapes = {"ticks": (), "cameras": cameras} | {f"commands.{name}": drives for name in Control._fields}
    if engine._presence.varies:
        shapes["present"] = (len(world.entities),)
    for name, shape in shapes.items():
        if name not in data or data[name].shape[1:] != shape:
            found = "is missing" if name not in data else f"has rows of shape {data[name].shape[1:]}, not {shape}"
            raise SnapshotError(f"the snapshot is damaged or not of this world: '{name}' {found}; take a new one")
    if len({len(rows) for rows in data.values()}) > 1:
        raise SnapshotError("the snapshot is damaged: its arrays hold different numbers of envs; take a new one")
    engine._refuse_rows(_under("engine.", data), snapshot.level)


def put_back(engine: "SimEngine", ids: Array, snapshot: Snapshot) -> None:
    """Write checked rows: who is there and parameters first, since an engine's state depends on them.

    A parameter that was changed since, but not when the snapshot was taken, gets its built value back.
    """
    data = snapshot.data
    engine._retire_state()
    if "present" in data:
        engine._reset(engine._admit(ids, data["present"]))
    for name in PARAMETERS:
        rows = data.get(f"parameter.{name}")
        if rows is None and name in engine._changed:
            rows = np.repeat(engine._default_parameter(name)[None], len(ids), axis=0)
        if rows is not None:
            engine._set_parameter(name, rows, ids, np.arange(int(rows.shape[1])))
            engine._changed[name] = None
    engine._commands.restore(ids, _under("commands.", data))
    engine._rig.poses[ids], engine._rig.fov[ids] = data["cameras"], data["fov"]
    engine._restore(ids, _under("engine.", data), snapshot.level)
    engine._ticks[ids] = data["ticks"]


def _under(prefix: str, data: Mapping[str, Array]) -> dict[str, Array]:
    """The entries of a snapshot whose names begin with `prefix`, without it."""
    return {name[len(prefix) :]: rows for name, rows in data.items() if name.startswith(prefix)}


def save(snapshot: Snapshot, path: str | Path) -> Path:
    """See `Snapshot.save`."""
    return snapshot_file.write(path, snapshot_file.ENGINE, stamp_of(snapshot), snapshot.data)


def load(path: str | Path) -> Snapshot:
    """See `Snapshot.load`."""
    content = snapshot_file.read(path)
    return stamped(content.stamp, snapshot_file.expect(content, snapshot_file.ENGINE, path))


def stamp_of(snapshot: Snapshot) -> dict[str, object]:
    """What a snapshot belongs to, as plain data."""
    return {
        "engine": snapshot.engine,
        "engine_version": snapshot.engine_version,
        "world_hash": snapshot.world_hash,
        "level": str(snapshot.level),
        "envs": snapshot.num_envs,
    }


def stamped(stamp: Mapping[str, Any], data: Mapping[str, Array]) -> Snapshot:
    """The snapshot of a stamp and its data."""
    level = SnapshotLevel(stamp["level"])
    return Snapshot(stamp["engine"], stamp["engine_version"], stamp["world_hash"], level, data)


def chosen_rows(snapshot: Snapshot, rows: Sequence[int] | Array) -> Snapshot:
    """See `Snapshot.rows`."""
    which = row_numbers(rows, snapshot.num_envs)
    return replace(snapshot, data={name: array[which] for name, array in snapshot.data.items()})


def row_numbers(rows: Sequence[int] | Array, count: int) -> Array:
    """Row numbers of a snapshot as an index array.

    Raises:
        SnapshotError: one is not in it.
    """
    which = np.asarray(rows)
    if which.ndim != 1 or (which.size and not np.issubdtype(which.dtype, np.integer)):
        raise SnapshotError(f"rows of a snapshot are chosen by their numbers, got {which.dtype} {which.shape}")
    if which.size and not 0 <= which.min() <= which.max() < count:
        raise SnapshotError(f"the snapshot has rows 0 to {count - 1}, not {which.tolist()}")
    return which.astype(int)


def joined(snapshots: Sequence[Snapshot]) -> Snapshot:
    """One snapshot of the envs of several, in order, such as those of engines that share the envs of a world.

    Raises:
        SnapshotError: there is none, they have different stamps, or a parameter was changed in one engine only.
    """
    if not snapshots:
        raise SnapshotError("there is no snapshot to join; pass one or more")
    first, waiting = snapshots[0], "commands.wrench"
    for other in snapshots[1:]:
        for name in ("engine", "engine_version", "world_hash", "level"):
            ours, theirs = getattr(first, name), getattr(other, name)
            if ours != theirs:
                raise SnapshotError(f"snapshots of {name.replace('_', ' ')} {ours} and {theirs} cannot be joined")
    parts = [dict(snapshot.data) for snapshot in snapshots]
    wrench = next((part[waiting] for part in parts if waiting in part), None)
    if wrench is not None:
        # where none waits, none is kept: it is a wrench of zero
        for part, snapshot in zip(parts, snapshots, strict=True):
            part.setdefault(waiting, np.zeros((snapshot.num_envs, *wrench.shape[1:])))
    return Snapshot(first.engine, first.engine_version, first.world_hash, first.level, joined_rows(parts))


def joined_rows(parts: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Rows of several mappings, one after the other, by name.

    Rows of an engine may have different lengths, such as saved files: the shorter ones get zeros at their end, which
    the engine passes over.

    Raises:
        SnapshotError: a name is not in all of them, or rows differ in more than their length.
    """
    names = dict.fromkeys(name for part in parts for name in part)
    for name in names:
        if not all(name in part for part in parts):
            raise SnapshotError(
                f"'{name}' is in some of the snapshots and not in all, so they cannot be joined; change a parameter in "
                f"all engines, or in none"
            )
    return {name: _stacked(name, [part[name] for part in parts]) for name in names}


def _stacked(name: str, rows: Sequence[Array]) -> Array:
    shapes = sorted({r.shape[1:] for r in rows})
    if len(shapes) == 1:
        return np.concatenate(rows)
    if any(len(shape) != 1 for shape in shapes):
        raise SnapshotError(f"rows of '{name}' have shapes {shapes[0]} and {shapes[-1]}; they cannot be joined")
    width = max(shape[0] for shape in shapes)
    return np.concatenate([np.pad(r, ((0, 0), (0, width - r.shape[1]))) for r in rows])
