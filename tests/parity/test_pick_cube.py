"""One task file, the same gains and skill on every engine: it succeeds, replays to the bit, and drifts little.

The tolerances of the drift hold for whole episodes with contact: the same actions on another engine, no feedback.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

JOINTS = 1e-2
"""[rad]: largest difference of a joint over an episode; the drive law is within 5e-3 in free motion, contact adds."""

POSES = 5e-2
"""[m]: largest difference of a body's pose. The cube is carried by friction and may turn a little between the pads."""

ENDINGS = 0.8
"""Share of episodes that end alike: a tape ends with the recorded success, and one that is a step late still runs."""


def anysim(*arguments: str) -> dict[str, Any]:
    """Run a command with --json and return what it printed."""
    command = [sys.executable, "-m", "anysim.cli", *arguments, "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("engine", "another", "rate"),
    [
        ("mujoco", "pybullet", 0.95),
        pytest.param("pybullet", "sapien", 0.90, marks=pytest.mark.full),
        pytest.param("sapien", "mujoco", 0.90, marks=pytest.mark.full),
    ],
)
def test_picks_succeed_replay_to_the_bit_and_drift_little(
    engine: str, another: str, rate: float, tmp_path: Path
) -> None:
    """32 episodes in 16 envs, without cameras: images need graphics drivers that not every machine has."""
    run = anysim(
        "run",
        "pick_cube",
        "--engine",
        engine,
        "-n",
        "16",
        "-k",
        "32",
        "-s",
        "1",
        "-o",
        "record.cameras=[]",
        "--out",
        str(tmp_path),
    )
    assert run["attempts"] == 32
    assert run["successes"] >= rate * 32
    own = anysim("replay", str(tmp_path))
    assert own["identical"] == own["replayed"] == run["successes"]
    other = anysim("replay", str(tmp_path), "--engine", another)
    drift = {row["name"]: row for row in other["drift"]}
    assert 0 < drift["joint_pos"]["worst"] <= JOINTS
    assert 0 < drift["body_pose"]["median"] <= POSES
    assert other["same_outcome"] >= ENDINGS * other["replayed"]
