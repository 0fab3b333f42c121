"""Snapshots as files: exact in another process, and refused, unread and unharmed, where they do not belong."""

import hashlib
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from anysim.engine.snapshots import file as snapshot_file
from anysim.engine.snapshots.file import decode, encode
from anysim.engine.snapshots.world_state import WorldState
from anysim.engine.state import Snapshot
from anysim.errors import SnapshotError
from anysim.randomization.streams import Origin
from anysim.task.snapshot import EnvSnapshot
from tests.runtime import light
from tests.runtime.model import action

GO_ON = """
import json, sys
import numpy as np
sys.path.insert(0, {root!r})
from anysim.task.snapshot import EnvSnapshot
from tests.runtime import light
from tests.runtime.test_snapshot_files import digest
with light.make({engine!r}, 3) as env:
    env.reset(seed=99)
    env.reset_to(EnvSnapshot.load({path!r}), [2, 0])
    print("DIGEST", digest(env, [2, 0]))
"""


def digest(env, ids: list[int]) -> str:
    """Observations, rewards and draws of the next steps, through a reset."""
    seen = hashlib.sha256()
    for step in range(12):
        running = env.running & np.isin(np.arange(env.num_envs), ids)
        if not running.any():
            env.reset(mask=np.isin(np.arange(env.num_envs), ids))
            continue
        rows = np.zeros((env.num_envs, env.action_dim))
        rows[ids] = [action(row, step, env.action_dim) for row in range(len(ids))]
        result = env.step(rows, running)
        for rows in (*(result.obs[group] for group in sorted(result.obs)), result.reward):
            seen.update(rows[ids].tobytes())
    seen.update(json.dumps([env.streams.draws[i] for i in ids]).encode())
    return seen.hexdigest()


def running(env, steps: int = 4):
    env.reset(seed=3)
    for step in range(steps):
        env.step(np.stack([action(i, step, env.action_dim) for i in range(env.num_envs)]))
    return env


def same(a, b) -> bool:
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list | tuple) and not isinstance(a, Origin):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


@pytest.mark.parametrize("engine", light.ENGINES)
def test_a_file_goes_on_in_another_process(get, engine, tmp_path) -> None:
    env = running(get(engine, 3))
    path = env.snapshot(np.array([True, False, True])).save(tmp_path / "a.snapshot")
    code = GO_ON.format(root=str(Path.cwd()), engine=engine, path=str(path))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("DIGEST ")[1].strip() == digest(env, [0, 2])


def test_everything_comes_back_as_it_was(get, tmp_path) -> None:
    env = running(get("null", 3))
    env.streams.draws[0]["odd"] = ("red", (0.1, float("inf")), np.float64(0.3), None, True)
    snapshot = env.snapshot()
    again = EnvSnapshot.load(snapshot.save(tmp_path / "a.snapshot"))
    assert same(dict(snapshot.streams), again.streams)
    assert same(dict(snapshot.managers), again.managers)
    assert same(dict(snapshot.engine.data), again.engine.data)
    state = again.streams["masters"][0]["state"]["state"]
    assert state > 2**64, "a generator's state is wider than 64 bits"
    assert snapshot.save(tmp_path / "b.snapshot").read_bytes() == (tmp_path / "a.snapshot").read_bytes()
    part = env.engine.snapshot([1])
    loaded = Snapshot.load(part.save(tmp_path / "engine.snapshot"))
    assert same(dict(part.data), loaded.data)
    assert (loaded.engine, loaded.world_hash, loaded.level) == (part.engine, part.world_hash, part.level)


def test_plain_values_are_exact() -> None:
    value = {"a": (1, [2**100, -0.0, float("-inf")]), "b": np.float32(0.1), "c": {"d": [(), "x", None, False]}}
    assert same(decode(json.loads(json.dumps(encode(value, {}))), {}), value)
    assert np.isnan(decode(encode(float("nan"), {}), {}))
    for wrong, says in (({"a": {1, 2}}, "a is a set"), ({1: 2}, "keys"), ({"~a": 1}, "keys")):
        with pytest.raises(SnapshotError, match=says):
            encode(wrong, {})
    with pytest.raises(SnapshotError, match="array of object"):
        encode({"a": np.array([object()])}, {})


def test_rows_are_chosen_and_joined(get, tmp_path) -> None:
    env = running(get("null", 3))
    whole = env.snapshot()
    parts = EnvSnapshot.joined([whole.rows([2]), whole.rows([0, 1])])
    assert same(dict(parts.streams), dict(whole.rows([2, 0, 1]).streams))
    env.reset_to(parts, [2, 0, 1])
    assert same(dict(env.snapshot().managers), dict(whole.managers))
    env.reset_to(whole.rows([1, 1, 1]))
    assert (env.obs["policy"] == env.obs["policy"][0]).all()
    with pytest.raises(SnapshotError, match=r"rows 0 to 2, not \[3\]"):
        whole.rows([3])
    with pytest.raises(SnapshotError, match="no snapshot to join"):
        EnvSnapshot.joined([])


def test_any_changed_byte_is_noticed(get, tmp_path) -> None:
    path = running(get("null", 3)).snapshot().save(tmp_path / "a.snapshot")
    good, wrong = path.read_bytes(), tmp_path / "wrong.snapshot"
    first = {*range(120), *range(len(good) - 400, len(good))}  # the first member's head, and the zip's directory
    for place in sorted(first | set(np.linspace(0, len(good) - 1, 150).astype(int).tolist())):
        damaged = bytearray(good)
        damaged[place] ^= 0x41
        wrong.write_bytes(bytes(damaged))
        with pytest.raises(SnapshotError):
            EnvSnapshot.load(wrong)
    for length in (0, 10, len(good) // 2, len(good) - 1):
        wrong.write_bytes(good[:length])
        with pytest.raises(SnapshotError, match="damaged or truncated"):
            EnvSnapshot.load(wrong)
    with pytest.raises(SnapshotError, match="cannot be read: No such file"):
        EnvSnapshot.load(tmp_path / "none.snapshot")


def test_nothing_hides_beside_the_members(get, tmp_path) -> None:
    good = running(get("null", 3)).snapshot().save(tmp_path / "a.snapshot").read_bytes()
    wrong = tmp_path / "wrong.snapshot"
    commented = good[:-2] + b"\x03\x00abc"
    for data in (b"#!/bin/sh\n" + good, good + b"more", commented):
        wrong.write_bytes(data)
        with pytest.raises(SnapshotError, match="no snapshot, or a damaged"):
            EnvSnapshot.load(wrong)


def test_a_file_of_unreasonable_size_is_not_read_or_written(get, tmp_path, monkeypatch) -> None:
    with (tmp_path / "a.snapshot").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(SnapshotError, match="the limit of a snapshot's file is 1,073,741,824 bytes: write fewer envs"):
        EnvSnapshot.load(tmp_path / "a.snapshot")
    snapshot = running(get("null", 3)).snapshot()
    small = snapshot_file.SNAPSHOT_HEADER_BYTES._replace(value=1000)
    monkeypatch.setattr(snapshot_file, "SNAPSHOT_HEADER_BYTES", small)
    with pytest.raises(SnapshotError, match=r"would not be read again: it has .* header"):
        snapshot.save(tmp_path / "b.snapshot")
    assert not (tmp_path / "b.snapshot").exists()


def test_a_pipe_is_no_snapshot(tmp_path) -> None:
    os.mkfifo(tmp_path / "a.snapshot")
    with pytest.raises(SnapshotError, match="is a pipe, not a file"):
        EnvSnapshot.load(tmp_path / "a.snapshot")


def rewritten(path: Path, out: Path, change, *, compression=zipfile.ZIP_STORED, extra: str = "") -> Path:
    """The file with a changed header, sealed anew: not an accident but somebody's work."""

    def add(name: str, content: bytes) -> None:
        info = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
        info.compress_type = compression
        other.writestr(info, content)

    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(out, "w", compression) as other:
        head = json.loads(archive.read(snapshot_file.HEADER))
        change(head)
        header = json.dumps(head).encode()
        add(snapshot_file.HEADER, header)
        add(snapshot_file.SEAL, snapshot_file._sha(header).encode())
        for info in archive.infolist():
            if info.filename not in (snapshot_file.HEADER, snapshot_file.SEAL):
                add(info.filename, archive.read(info))
        if extra:
            add(extra, b"x")
    return out


def test_a_snapshot_that_was_changed_is_refused(get, tmp_path) -> None:
    path = running(get("null", 3)).snapshot().save(tmp_path / "a.snapshot")
    out = tmp_path / "b.snapshot"

    def refused(says: str, change=lambda head: None, **options) -> None:
        with pytest.raises(SnapshotError, match=says):
            EnvSnapshot.load(rewritten(path, out, change, **options))

    EnvSnapshot.load(rewritten(path, out, lambda head: None))
    refused("format anysim-snapshot 2; anysim .* reads up to 1: install a newer", lambda h: h.update(version=2))
    refused("is packed", compression=zipfile.ZIP_DEFLATED)
    refused("should hold", extra="../../evil")
    refused("numpy 0.1", lambda h: h["made_with"].update(numpy="0.1"))
    refused("replay the episode", lambda h: h["made_with"].update(machine="pdp11"))
    refused("its format is 'x'", lambda h: h.update(format="x"))
    refused("does not have its hash", lambda h: next(iter(h["arrays"].values())).update(sha256="0"))
    refused("packed, or larger than it says", lambda h: next(iter(h["arrays"].values())).update(bytes=3))
    refused("load it with WorldState.load", lambda h: h.update(kind="world state"))
    header = np.lib.format.magic(1, 0) + b"v\x00{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(120)
    with pytest.raises(ValueError, match="not the array"):
        snapshot_file._array(header[:-1] + b"\n", "x")
    with pytest.raises(SnapshotError, match=r"load it with EnvSnapshot.load"):
        WorldState.load(path)


def test_a_file_is_there_whole_or_not_at_all(get, tmp_path, monkeypatch) -> None:
    snapshot = running(get("null", 3)).snapshot()
    path = snapshot.save(tmp_path / "a.snapshot")
    before = path.read_bytes()

    def fails(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(snapshot_file.os, "fsync", fails)
    with pytest.raises(SnapshotError, match="cannot be written: No space left"):
        snapshot.rows([0]).save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.snapshot"]
    assert path.read_bytes() == before


def test_a_foreign_snapshot_changes_nothing(get) -> None:
    """Another world, task, engine or version: a sentence with both, before the first row is written."""
    env, other = running(get("null", 3)), get("null", 3, "blocks_only")
    other.reset(seed=1)
    theirs = other.snapshot()
    ours = env.snapshot()

    def refused(snapshot: EnvSnapshot, *says: str) -> None:
        before = env.snapshot()
        for words in says:
            with pytest.raises(SnapshotError, match=words):
                env.reset_to(snapshot)
        after = env.snapshot()
        assert same(dict(after.managers), dict(before.managers))
        assert same(dict(after.streams), dict(before.streams))
        assert same(dict(after.engine.data), dict(before.engine.data))

    def with_engine(**values: str) -> EnvSnapshot:
        stamp = {f: getattr(ours.engine, f) for f in ("engine", "engine_version", "world_hash", "level", "data")}
        return EnvSnapshot(Snapshot(**(stamp | values)), ours.managers, ours.streams, ours.task, ours.spec_hash)

    refused(theirs, "taken with world .* this is .* carry a WorldState over")
    refused(with_engine(engine="mujoco"), "taken with engine mujoco, this is null")
    refused(with_engine(engine_version="0.0.0"), "engine version 0.0.0, this is")
    refused(EnvSnapshot(ours.engine, ours.managers, ours.streams, "x", "0"), "with the spec 0, this is 'slide'")
    fewer = {name: data for name, data in ours.managers.items() if name != "robot"}
    refused(EnvSnapshot(ours.engine, fewer, ours.streams, ours.task, ours.spec_hash), "this env has .*robot")
    odd = {**ours.managers, "task": {k: v for k, v in ours.managers["task"].items() if k != "held"}}
    refused(
        EnvSnapshot(ours.engine, odd, ours.streams, ours.task, ours.spec_hash),
        r"state of 'task': 'held' is missing; nothing was changed",
    )
    cut = with_engine(data={k: v for k, v in ours.engine.data.items() if k != "ticks"})
    refused(cut, "'ticks' is missing")


def test_the_journal_of_sapien_has_a_format(get) -> None:
    env = running(get("sapien", 3))
    snapshot = env.engine.snapshot()
    for change, says in (
        ({"engine.journal_format": np.full(3, 9)}, "journal has format 9, this anysim-mechanics reads 1"),
        ({"engine.length": np.full(3, 10**9)}, "damaged"),
        ({"engine.journal": np.full_like(snapshot.data["engine.journal"], 77.0)}, "no entry of a journal"),
    ):
        damaged = Snapshot(
            snapshot.engine, snapshot.engine_version, snapshot.world_hash, snapshot.level, {**snapshot.data, **change}
        )
        before = env.engine.get_state().body_pose
        with pytest.raises(SnapshotError, match=says):
            env.engine.restore(damaged)
        assert (env.engine.get_state().body_pose == before).all()
