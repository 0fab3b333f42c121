"""A run with skills, a planner and segments that is killed and begun again; and what a terminal shows of one."""

import json
import os
import pty
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim_inspect.verify import verify_run
from tests.plugins.sharded.shards_help import gone

WORLDS = Path(__file__).parents[1] / "skills/worlds"
EPISODES = 8
KILLS = 2


def command(world: str, episodes: int, out: Path, *words: str) -> list[str]:
    program = [sys.executable, "-m", "anysim.cli", "run", str(WORLDS / f"{world}.yaml"), "--engine", "mujoco"]
    return [*program, "--num-envs", "4", "--episodes", str(episodes), "--seed", "5", "--out", str(out), *words]


def manifests(out: Path) -> dict[str, dict[str, Any]]:
    """Everything that equal trajectories share, with the hashes of their files."""
    found = {path.parent.name: json.loads(path.read_text()) for path in out.glob("episodes/*/manifest.json")}
    return {name: {k: v for k, v in manifest.items() if k != "clock"} for name, manifest in found.items()}


def children(process: int) -> list[int]:
    """Ids of the processes that a process has started."""
    lists = Path(f"/proc/{process}/task").glob("*/children")
    return [int(pid) for path in lists for pid in path.read_text().split()]


@pytest.mark.slow
def test_a_run_that_is_killed_is_resumed_to_the_same_manifests(tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    subprocess.run(command("fetch_in_parts", EPISODES, whole, "--json"), check=True, capture_output=True, timeout=300)
    wanted = manifests(whole)
    assert len(wanted) >= 0.75 * EPISODES
    segments = [manifest["outcome"]["segments"] for manifest in wanted.values()]
    assert max(map(len, segments)) == 2
    out, rng, there = tmp_path / "killed", np.random.default_rng(1), 0
    for _ in range(KILLS):
        with subprocess.Popen(command("fetch_in_parts", EPISODES, out, "--json"), stdout=subprocess.DEVNULL) as process:
            while process.poll() is None and len(list(out.glob("episodes/*/manifest.json"))) <= there:
                time.sleep(0.02)
            time.sleep(float(rng.uniform(0.0, 0.3)))
            planners = children(process.pid)
            process.kill()
        assert gone(planners), "a planner outlived its run"
        there = len(manifests(out))
        assert not any(verify_run(out).values())
        assert manifests(out).items() <= wanted.items()
    assert 0 < there
    done = subprocess.run(command("fetch_in_parts", EPISODES, out), check=True, capture_output=True, timeout=300)
    assert b"resuming" in done.stdout + done.stderr
    assert manifests(out) == wanted


def test_a_terminal_shows_a_table_that_grows(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    size = {"COLUMNS": "120", "LINES": "40", "TERM": "xterm-256color"}
    words, shown = command("behind_wall", 4, tmp_path / "run"), b""
    with subprocess.Popen(words, stdin=theirs, stdout=theirs, stderr=theirs, env=os.environ | size) as process:
        os.close(theirs)
        while True:
            try:
                shown += os.read(ours, 4096)
            except OSError:  # the program has ended
                break
        assert process.wait(60) == 0, shown.decode()
    os.close(ours)
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode())
    counts = [int(count) for count in re.findall(r"(\d+) of 4 episodes", text)]
    assert counts[0] == 0
    assert counts == sorted(counts)
    for said in ("behind_wall on mujoco", "none yet", "failures", "in the queue"):
        assert said in text
    assert re.search(r"[1-9]\d* answered", text)
    assert b"\x1b[" in shown, "the table is drawn over itself"
    assert "env 0 episode 0" not in text, "lines are for pipes"
