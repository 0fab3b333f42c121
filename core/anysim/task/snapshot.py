"""Envs at one moment, in memory and in files: what a snapshot holds, what it belongs to, and how rows are put together.

A file is one container of arrays and JSON (`anysim.engine.snapshots.file`): no code is stored or run.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots import file as snapshot_file
from anysim.engine.snapshots.row_checks import SENSIBLE, damaged, mapping_of_arrays, refuse_other_forms
from anysim.engine.state import Snapshot, joined, joined_rows, row_numbers, stamp_of, stamp_words, stamped
from anysim.errors import SnapshotError, listing
from anysim.randomization.streams import Streams
from anysim_schemas.run import RunSpec

_ELSEWHERE = frozenset({"engine", "num_envs", "record", "robot", "alternates"})
"""Keys of a spec that do not say what an episode is; the engine has a stamp of its own, the robot is in the world."""


@lru_cache(maxsize=16)
def _hash_of(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def spec_hash(spec: RunSpec) -> str:
    """SHA-256 of what a spec says of world and task: managers and terms of equal hashes hold the same state.

    Levels count where one is merged in, not as what else could be chosen.
    """
    said = {key: value for key, value in {**spec.to_dict(), "levels": {}}.items() if key not in _ELSEWHERE}
    return _hash_of(json.dumps(said))


@dataclass(frozen=True)
class EnvSnapshot:
    """Envs at one moment: the engine's rows, every manager's rows, the streams and the clocks.

    Attributes:
        engine: the engine's rows, with its stamp.
        managers: of each manager, and of the task, arrays with a leading env axis.
        streams: both levels of randomness, what was drawn, and what was overridden.
        task: the name of the task.
        spec_hash: of world and task, as `spec_hash` makes it.
    """

    engine: Snapshot
    managers: Mapping[str, Mapping[str, Array]] = field(repr=False)
    streams: Mapping[str, Any] = field(repr=False)
    task: str = ""
    spec_hash: str = ""

    @property
    def num_envs(self) -> int:
        """How many envs it holds."""
        return self.engine.num_envs

    def rows(self, rows: Sequence[int] | Array) -> "EnvSnapshot":
        """Some of its envs, in this order; one may come several times.

        Raises:
            SnapshotError: a row is not in it.
        """
        which = row_numbers(rows, self.num_envs)
        managers = {
            owner: {name: array[which] for name, array in data.items()} for owner, data in self.managers.items()
        }
        streams = {name: [values[i] for i in which] for name, values in self.streams.items()}
        return EnvSnapshot(self.engine.rows(which), managers, streams, self.task, self.spec_hash)

    @classmethod
    def joined(cls, snapshots: Iterable["EnvSnapshot"]) -> "EnvSnapshot":
        """The envs of several snapshots in one, in order.

        Raises:
            SnapshotError: there is none, or they are of different tasks, worlds, engines or versions.
        """
        parts = list(snapshots)
        if not parts:
            raise SnapshotError("there is no snapshot to join; pass one or more")
        first = parts[0]
        for other in parts[1:]:
            if other.spec_hash != first.spec_hash or other.managers.keys() != first.managers.keys():
                raise SnapshotError(
                    f"snapshots of '{first.task}' and '{other.task}' cannot be joined: their specs differ"
                )
        managers = {owner: joined_rows([part.managers[owner] for part in parts]) for owner in first.managers}
        streams = {name: [value for part in parts for value in part.streams[name]] for name in first.streams}
        engine = joined([part.engine for part in parts])
        return cls(engine, managers, streams, first.task, first.spec_hash)

    def save(self, path: str | Path) -> Path:
        """Write a file that `load` reads in any process; an existing one is replaced.

        Raises:
            SnapshotError: it cannot be written, or something was drawn that has no exact form in a file.
        """
        seeds = [int(seed) for seed in self.streams["episode_seed"]]
        steps = [int(n) for n in self.managers["task"]["elapsed"]]
        stamp = {
            "task": self.task,
            "spec_hash": self.spec_hash,
            **stamp_of(self.engine),
            "episode_seeds": seeds,
            "elapsed_steps": steps,
        }
        data = {"engine": self.engine.data, "managers": self.managers, "streams": self.streams}
        return snapshot_file.write(path, snapshot_file.ENV, stamp, data)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Raises:
            SnapshotError: the file is damaged, of a newer format, or was made with other versions.
        """
        content = snapshot_file.read(path)
        data, stamp = snapshot_file.expect(content, snapshot_file.ENV, path), content.stamp
        if not isinstance(data, Mapping) or data.keys() != {"engine", "managers", "streams"}:
            raise damaged("it should hold the engine's, the managers' and the streams' state")
        owners = {"": data["managers"]} if not isinstance(data["managers"], Mapping) else data["managers"]
        managers = {name: mapping_of_arrays(f"'{name}'", rows) for name, rows in owners.items()}
        task, spec = stamp_words(stamp, "task", "spec_hash")
        return cls(stamped(stamp, data["engine"]), managers, data["streams"], task, spec)


def refuse_foreign(
    snapshot: EnvSnapshot, task: str, wanted_hash: str, present: Mapping[str, Mapping[str, Array]], envs: int
) -> None:
    """Refuse a snapshot of another spec, or one that this one could not have made, before anything is changed.

    Args:
        present: what a snapshot of one env of this task holds of its managers now.
        envs: how many it should hold.

    Raises:
        SnapshotError: another spec or other managers, with what differs and the remedy.
    """
    if snapshot.spec_hash != wanted_hash:
        raise SnapshotError(
            f"the snapshot is of '{snapshot.task}' with the spec {snapshot.spec_hash[:12]}, this is '{task}' with the "
            f"spec {wanted_hash[:12]}; nothing was changed. Make the env from the spec that it was taken with (a "
            f"recording holds it in its manifest), or carry a WorldState over"
        )
    if snapshot.managers.keys() != present.keys():
        theirs, ours = sorted(snapshot.managers), sorted(present)
        raise SnapshotError(
            f"the snapshot has the state of {listing(theirs)}, this env has {listing(ours)}; nothing was changed. "
            f"Take a new one"
        )
    task_rows = mapping_of_arrays("the state of 'task'", snapshot.managers["task"])
    refuse_other_forms("the state of 'task'", task_rows, present["task"], envs, faulty=np.ones(envs, dtype=bool))
    for owner, data in present.items():
        rows = mapping_of_arrays(f"the state of '{owner}'", snapshot.managers[owner])
        refuse_other_forms(f"the state of '{owner}'", rows, data, envs, faulty=task_rows["fault"], most=SENSIBLE)
    if words := Streams.fault(snapshot.streams, envs):
        raise damaged(f"the random streams: {words}")
