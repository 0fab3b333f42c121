"""Snapshots of random scenes on each engine: going on from one is the uninterrupted run, to the bit."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from anysim.engine.capability import Capability
from anysim.testing import tolerances
from anysim.testing.compare import MOTION
from anysim.testing.engines import require_engine
from tests.parity import random_scenes as scenes

COUNTS = [pytest.param(15, marks=pytest.mark.slow), pytest.param(100, marks=pytest.mark.full)]
BEFORE, LONGEST_FALL, AFTER = 15, 60, 10
"""Rounds of new commands, of 1 to 4 physics steps each."""

ENGINES = ("null", "mujoco", "pybullet", "sapien")


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("name", ENGINES)
def test_snapshots_of_random_scenes(name, count, tmp_path, capsys):
    """After a wild history, in other envs of a new engine, and in another process; and at the level STATE at once."""
    exact = Capability.SNAPSHOT_TRAJECTORY in require_engine(name).capabilities
    wrong: list[str] = []
    touching, worst, taken, wanted = 0, 0.0, {}, {}
    for number in range(count):
        with scenes.build(name, number) as engine:
            scenes.treat(engine, number, 1, BEFORE, [0, 1])
            touching += scenes.until_touch(engine, number, LONGEST_FALL)
            before = {field: getattr(engine.get_state(), field).copy() for field in MOTION}
            close = engine.snapshot(level="state")
            if exact:
                taken[number] = engine.snapshot()
                wanted[number] = [scenes.state_digest(engine, [0, 1]), scenes.treat(engine, number, 2, AFTER, [0, 1])]
                scenes.wild(engine, number)
                engine.restore(taken[number])
                found = [scenes.state_digest(engine, [0, 1]), scenes.treat(engine, number, 2, AFTER, [0, 1])]
                wrong += _differences(found, wanted[number], f"scene {number} after a wild history")
            scenes.wild(engine, number)
            engine.restore(close)
            for field, value in before.items():
                worst = max(worst, float(np.abs(getattr(engine.get_state(), field) - value).max(initial=0.0)))
        if exact:
            with scenes.build(name, number, 3) as other:
                other.step(3)
                other.restore(taken[number], [2, 0])
                found = [scenes.state_digest(other, [2, 0]), scenes.treat(other, number, 2, AFTER, [2, 0])]
                wrong += _differences(found, wanted[number], f"scene {number} in another engine")
    if exact:
        found = _elsewhere(name, taken, tmp_path)
        for number, digests in wanted.items():
            wrong += _differences(found[number], digests, f"scene {number} in another process")
    with capsys.disabled():
        held = max((sum(a.nbytes for a in s.data.values()) for s in taken.values()), default=0) / scenes.ENVS
        print(
            f"\n{name}: {count} scenes, {touching} in touch at the snapshot, {len(wrong)} differ; at the level state "
            f"off by up to {worst:.2g}; {held / 1024:.0f} KiB an env at most"
        )
    assert not wrong, "\n".join(wrong)
    assert worst <= tolerances.READ_BACK
    if Capability.CONTACT_POINTS in require_engine(name).capabilities and name != "null":
        assert touching >= 0.85 * count, "the scenes are to be in touch where they are saved"


def _differences(found: list[str], wanted: list[str], where: str) -> list[str]:
    """Nothing, or a line that says what differs."""
    parts = [what for a, b, what in zip(found, wanted, ("at once", "going on"), strict=True) if a != b]
    return [f"{where}: differs {' and '.join(parts)}"] if parts else []


def _elsewhere(name, taken, folder: Path) -> dict[int, list[str]]:
    """What another process makes of the snapshots, which it gets through a file."""
    file = folder / "snapshots.npz"
    scenes.store(taken, file)
    command = [sys.executable, scenes.__file__, name, str(file), str(AFTER)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    return {int(number): digests for number, digests in json.loads(done.stdout.splitlines()[-1]).items()}
