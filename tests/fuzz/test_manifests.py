"""Forged recordings with right hashes: every reader says in a sentence what is wrong, or reads what is there."""

import hashlib
import json
import shutil
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.record.manifest import read_run
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory, world_state
from anysim.record.replay import begin, rebuild
from anysim_inspect.verify import verify
from anysim_recording.collector import Collector
from tests.fuzz.budget import Tally
from tests.fuzz.forging import forged_trees, replaced
from tests.plugins.mcap import conftest as sample
from tests.runtime import light

pytestmark = pytest.mark.filterwarnings("default")


class Still:
    """A policy that does nothing, for envs without actions."""

    def __init__(self, envs: int) -> None:
        self._envs = envs

    def begin(self, env_ids: np.ndarray) -> None:
        """Nothing to prepare."""

    def act(self, env_ids: np.ndarray) -> np.ndarray:
        """No action."""
        return np.zeros((len(env_ids), 0))

    def gave_up(self, env_ids: np.ndarray) -> np.ndarray:
        """Never."""
        return np.zeros(len(env_ids), dtype=bool)

    def solved(self, env_ids: np.ndarray) -> np.ndarray:
        """Nothing to say."""
        return np.zeros(len(env_ids), dtype=bool)

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        """Nothing to say."""
        del env, success
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        """Nothing to say."""
        return {}


def recorded(out: Path) -> Path:
    """A trajectory of an env that anyone can build: it can be replayed."""
    spec = {**light.BLOCKS_ONLY, "engine": {"name": "null"}, "record": {"keep": "all"}}
    with anysim.make(spec, num_envs=1) as env:
        assert list(Collector(env, Still(1), out, 1, seed=5).run())
    return trajectories(out)[0]


def filmed(out: Path) -> Path:
    """A trajectory with two videos."""
    return sample.recorded(out)


def changed_files(directory: Path, seed: int) -> Iterator[tuple[str, dict[str, bytes]]]:
    """Damaged files: bytes that are flipped, cut off, put twice, zeroed, or other files."""
    rng = np.random.default_rng(seed)
    good = {p.name: p.read_bytes() for p in sorted(directory.iterdir()) if p.name != "manifest.json"}
    while True:
        name = sorted(good)[int(rng.integers(len(good)))]
        data = bytearray(good[name])
        at, size = int(rng.integers(len(data))), int(rng.integers(1, 64))
        match kind := ("flip", "zero", "cut", "twice", "noise", "other")[int(rng.integers(6))]:
            case "flip":
                data[at] ^= int(rng.integers(1, 256))
            case "zero":
                data[at : at + size] = bytes(len(data[at : at + size]))
            case "cut":
                del data[at : at + size]
            case "twice":
                data[at:at] = data[at : at + size]
            case "noise":
                data[at : at + size] = rng.bytes(len(data[at : at + size]))
            case _:
                data = bytearray(good[sorted(good)[int(rng.integers(len(good)))]])
        yield f"{name} {kind} at {at}", {name: bytes(data)}


class Target:
    """A copy of a recording into which forgeries are put."""

    def __init__(self, source: Path, folder: Path) -> None:
        self.source = source
        self.path = folder / source.name
        self.manifest: dict[str, Any] = json.loads((source / "manifest.json").read_text())

    def forged(self, manifest: Any, files: dict[str, bytes], *, sealed: bool = True) -> None:
        """Write a copy with another manifest and other files, whose hashes are right."""
        shutil.rmtree(self.path, ignore_errors=True)
        shutil.copytree(self.source, self.path)
        for name, data in files.items():
            (self.path / name).write_bytes(data)
            if sealed:
                entry = {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
                manifest = replaced(manifest, ("files", name), entry)
        text = json.dumps(manifest, default=str)
        (self.path / "manifest.json").write_text(text)

    def read(self) -> None:
        """Verify it, and read all of it, whatever `verify` says."""
        faults = verify(self.path)
        assert all(isinstance(fault, str) and fault for fault in faults)
        reader = open_trajectory(self.path)
        reader.faults()
        for name in ("times", "actions", "states", "obs", "rewards", "statuses", "annotations", "language"):
            getattr(reader, name)
        assert reader.initial_obs is not None
        for camera in reader.manifest.cameras:
            for _ in islice(reader.images(camera), 100):
                pass
        for step in (0, reader.manifest.steps):
            world_state(reader, step)

    def replay(self) -> None:
        """Build its env anew and go on as it did."""
        self.read()
        reader = open_trajectory(self.path)
        with rebuild(reader.manifest, None) as env:
            begin(env, reader.manifest)
            for action in reader.actions[:3]:
                env.step(action[None])

    def run_file(self) -> None:
        """Read it as the description of a run."""
        read_run(self.path)


def forge(folder: Path, count: int) -> None:
    tally = Tally("forged recordings")
    film, plain = (Target(make(folder / name), folder) for name, make in (("film", filmed), ("plain", recorded)))
    for target, share, load in ((film, 0.25, film.read), (plain, 0.5, plain.replay)):
        for label, tree in forged_trees({"m": target.manifest}, int(share * count) - tally.inputs, seed=7):
            target.forged(tree.get("m"), {})
            tally.run(f"manifest {label}", load)
    for label, files in islice(changed_files(film.source, seed=8), int(0.9 * count) - tally.inputs):
        film.forged(film.manifest, files)
        tally.run(f"file {label}", film.read)
    run = json.loads((plain.source.parents[1] / "run.json").read_text())
    for label, tree in forged_trees({"m": run}, count - tally.inputs, seed=9):
        plain.forged(plain.manifest, {"run.json": json.dumps(tree.get("m"), default=str).encode()}, sealed=False)
        tally.run(f"run {label}", plain.run_file)
    tally.passed(count)


@pytest.mark.full
def test_forged_recordings(tmp_path: Path) -> None:
    forge(tmp_path, 1000)


def test_some_forged_recordings(tmp_path: Path) -> None:
    forge(tmp_path, 40)
