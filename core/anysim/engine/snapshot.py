"""Files, rows and joins of an engine's snapshots."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anysim.conventions import Array
from anysim.engine import snapshot_file
from anysim.engine.state import Snapshot, SnapshotLevel
from anysim.errors import SnapshotError

if TYPE_CHECKING:
    pass


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
