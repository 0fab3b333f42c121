"""Forged snapshots with right hashes: refused in a sentence before anything is changed, or as good as a true one."""

import hashlib
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.engine.snapshots import file as snapshot_file
from anysim.engine.snapshots.file import ENGINE, ENV, FORMAT, VERSION, WORLD, encode, made_with
from anysim.engine.snapshots.world_state import WorldState
from anysim.engine.state import Snapshot, stamp_of
from anysim.errors import AnysimError, SnapshotError
from anysim.task.env import TaskEnv
from anysim.task.snapshot import EnvSnapshot
from tests.fuzz.budget import Tally
from tests.fuzz.forging import forged_trees, write_file
from tests.runtime import light

pytestmark = pytest.mark.filterwarnings("default")


def head_of(kind: str) -> dict[str, Any]:
    return {"format": FORMAT, "version": VERSION, "kind": kind, "made_with": dict(made_with())}


def digest(env: TaskEnv) -> str:
    """Everything that an env holds: engine, managers, streams, clocks, and what it shows."""
    arrays: dict[str, Any] = {}
    snapshot = env.snapshot()
    world = env.engine.world_state()
    # Bullet's own file holds addresses, which are others in a client that was made anew
    rows = {name: array for name, array in snapshot.engine.data.items() if name != "engine.bullet"}
    tree = {
        "engine": rows,
        "managers": snapshot.managers,
        "streams": snapshot.streams,
        "obs": env.obs,
        "info": env.info,
        "status": [str(word) for word in env.status],
        "world": {"pose": world.body_pose, "twist": world.body_twist, "parameters": sorted(world.parameters)},
    }
    text = hashlib.sha256(json.dumps(encode(tree, arrays)).encode())
    for array in arrays.values():
        text.update(np.ascontiguousarray(array).tobytes())
    return text.hexdigest()


def go_on(env: TaskEnv) -> None:
    """What anyone does with a state that was accepted: step, look, save, and begin again."""
    for _ in range(2):
        running = env.running
        if running.any():
            env.step(np.zeros((env.num_envs, env.action_dim)), running)
    env.snapshot()
    env.engine.world_state()
    env.reset()


class Target:
    """An env in the middle of an episode, into which forged files are put."""

    def __init__(self, engine: str, spec: str, folder: Path) -> None:
        self.env = light.make(engine, 2, light.SPECS[spec])
        self.file = folder / "forged.snapshot"
        self.env.reset(seed=3)
        for step in range(3):
            self.env.step(np.full((2, self.env.action_dim), 0.5 - 0.3 * step))
        self.good = self.env.snapshot()
        self.settled = self.settle()
        self.followed = self.follow()

    def follow(self) -> str:
        """What comes of the env in the next steps, from where it was."""
        self.env.reset_to(self.good)
        for step in range(5):
            self.env.step(np.full((2, self.env.action_dim), 0.1 * step - 0.3))
        found = digest(self.env)
        self.env.reset_to(self.good)
        return found

    def settle(self) -> str:
        """Bring the env back to where it was; what it is then."""
        self.env.reset_to(self.good)
        return digest(self.env)

    def tree(self) -> tuple[Any, Any]:
        data = {"engine": self.good.engine.data, "managers": self.good.managers, "streams": self.good.streams}
        stamp = {"task": self.good.task, "spec_hash": self.good.spec_hash, **stamp_of(self.good.engine)}
        return data, stamp

    def env_file(self) -> None:
        self.env.reset_to(EnvSnapshot.load(self.file))

    def engine_file(self) -> None:
        self.env.engine.restore(Snapshot.load(self.file))

    def world_file(self) -> None:
        self.env.engine.set_world_state(WorldState.load(self.file))

    def tried(self, tally: Tally, label: str, load: Any) -> None:
        """Put the file in; whatever comes of it, nothing is half done."""
        refused = tally.run(label, load)
        if refused is not None:
            if digest(self.env) != self.settled:
                tally.fault(label, f"refused ({refused}), and something was changed")
                self.settle()
            return
        try:
            go_on(self.env)
        except AnysimError as error:
            tally.fault(label, f"accepted, and then: {error}")
        except Exception as error:  # noqa: BLE001 - that is what is looked for
            tally.fault(label, error)
        if self.settle() != self.settled:
            tally.fault(label, "left something behind")


def forge(engine: str, count: int, folder: Path) -> None:
    tally = Tally(f"forged snapshots of {engine}")
    target = Target(engine, "mixed" if engine in ("null", "mujoco") else "slide", folder)
    with target.env:
        data, stamp = target.tree()
        for label, tree in forged_trees({"data": data, "stamp": stamp}, count // 2, seed=1):
            write_file(target.file, head_of(ENV), tree.get("data"), tree.get("stamp"))
            target.tried(tally, f"env {label}", target.env_file)
        rows = {"data": dict(target.good.engine.data), "stamp": stamp_of(target.good.engine)}
        for label, tree in forged_trees(rows, count // 5, seed=2):
            write_file(target.file, head_of(ENGINE), tree.get("data"), tree.get("stamp"))
            target.tried(tally, f"engine {label}", target.engine_file)
        state = snapshot_file.read(target.env.engine.world_state().save(target.file))
        for label, tree in forged_trees({"data": state.data}, count // 5, seed=3):
            write_file(target.file, head_of(WORLD), tree.get("data"), {})
            target.tried(tally, f"world state {label}", target.world_file)
        with zipfile.ZipFile(target.good.save(target.file)) as archive:
            head = json.loads(archive.read(snapshot_file.HEADER))
        del head["data"], head["stamp"]
        for label, wrong in forged_trees({"head": head}, count - tally.inputs, seed=4):
            write_file(target.file, wrong.get("head"), data, stamp)
            target.tried(tally, f"header {label}", target.env_file)
        assert target.follow() == target.followed, "something was left behind"
    tally.passed(count)


@pytest.mark.full
@pytest.mark.parametrize(("engine", "count"), [("null", 1000), ("mujoco", 400), ("pybullet", 300), ("sapien", 300)])
def test_forged_snapshots(engine: str, count: int, tmp_path: Path) -> None:
    forge(engine, count, tmp_path)


def test_some_forged_snapshots(tmp_path: Path) -> None:
    forge("null", 100, tmp_path)


@pytest.mark.parametrize("part", ["engine", "manager"])
def test_what_fails_on_the_way_leaves_everything_as_it_was(part: str, tmp_path: Path, monkeypatch: Any) -> None:
    """An engine, or a controller of a plugin, may refuse what passed every check."""
    target = Target("null", "mixed", tmp_path)
    with target.env as env:
        env.step(np.zeros((2, env.action_dim)))
        before, owner = digest(env), env.engine if part == "engine" else env.actions
        name = "_restore" if part == "engine" else "restore"
        plain, calls = getattr(owner, name), []

        def fails(*args: Any) -> None:
            plain(*args)
            calls.append(args)
            if len(calls) == 1:
                raise ValueError("no such state")

        monkeypatch.setattr(owner, name, fails)
        with pytest.raises(SnapshotError if part == "engine" else ValueError, match="no such state"):
            env.reset_to(target.good)
        assert digest(env) == before
        env.reset_to(target.good)
        assert digest(env) == target.settled
