"""`anysim serve` as a process: what it prints and keeps, and how it ends."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim_client.errors import ConnectionLost
from tests.plugins.serving.helpers import BLOCKS, local, same


def world(folder: Path) -> Path:
    path = folder / "blocks.yaml"
    path.write_text(json.dumps(BLOCKS))  # JSON is YAML
    return path


def started(folder: Path, *more: str) -> tuple[subprocess.Popen[str], list[str]]:
    """A service in a process of its own, and the lines that it prints until it answers."""
    command = [sys.executable, "-m", "anysim.cli", "serve", str(world(folder)), "--port", "0", *more]
    environment = os.environ | {"ANYSIM_STATE_DIR": str(folder / "state"), "PYTHONUNBUFFERED": "1"}
    environment.pop("ANYSIM_SERVE_TOKEN", None)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    assert process.stdout is not None
    lines: list[str] = []
    for line in process.stdout:
        lines.append(line)
        if line.startswith("use it"):
            return process, lines
    raise AssertionError(f"{process.wait(30)}: {''.join(lines)}")


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_it_serves_and_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals) -> None:
    monkeypatch.setenv("ANYSIM_STATE_DIR", str(tmp_path / "state"))
    monkeypatch.delenv("ANYSIM_SERVE_TOKEN", raising=False)
    process, lines = started(tmp_path, "--num-envs", "2")
    try:
        text = "".join(lines)
        address = re.search(r"http://127\.0\.0\.1:\d+", text)
        assert address is not None
        kept = next((tmp_path / "state" / "services").iterdir())
        assert kept.stat().st_mode & 0o777 == 0o600
        token = re.search(r"token: (\S{43})\n", text)
        assert token is not None
        assert text.count(token.group(1)) == 1
        env = anysim.connect(address.group())  # with the token that was kept
        with local(num_envs=2) as near:
            assert same(env.reset(seed=1), near.reset(seed=1))
        process.send_signal(number)
        rest = process.stdout.read()  # type: ignore[union-attr]
        assert process.wait(60) == 0, rest
        assert rest == "ended: all envs are freed\n"
        assert not kept.exists()
        with pytest.raises(ConnectionLost):
            env.step(np.zeros((2, 0)))
        env.close()
    finally:
        process.kill()
        process.wait()
        process.stdout.close()  # type: ignore[union-attr]


@pytest.mark.slow
def test_one_that_is_killed_leaves_its_clients_an_error_and_another_takes_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ANYSIM_STATE_DIR", str(tmp_path / "state"))
    process, lines = started(tmp_path, "--no-token")
    try:
        assert "warning: there is no token" in "".join(lines)
        address = re.search(r"http://[0-9.:]+", "".join(lines)).group()  # type: ignore[union-attr]
        env = anysim.connect(address)
        env.reset(seed=0)
        process.kill()
        process.wait()
        process.stdout.close()  # type: ignore[union-attr]
        with pytest.raises(ConnectionLost):
            env.step(np.zeros((1, 0)))
        process, _ = started(tmp_path, "--no-token", "--port", address.rpartition(":")[2])
        with pytest.raises(ConnectionLost):
            env.reset(seed=0)  # its session went with the first one
        env.close()
        with anysim.connect(address) as again, local() as near:
            assert same(again.reset(seed=3), near.reset(seed=3))
            assert same(tuple(again.step(np.zeros((1, 0)))), tuple(near.step(np.zeros((1, 0)))))
    finally:
        process.kill()
        process.wait()
        process.stdout.close()  # type: ignore[union-attr]


@pytest.mark.slow
def test_exchanges_and_many_clients_are_measured() -> None:
    command = [
        sys.executable,
        "-m",
        "anysim.cli",
        "bench",
        "serve",
        "--seconds",
        "0.1",
        "--soak",
        "1",
        "--clients",
        "3",
    ]
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, timeout=300, check=True)
    found = json.loads(done.stdout)
    rows = found["exchanges"]
    assert [round(row["megabytes"], 1) for row in rows] == [0.0, 12.6, 12.6]
    assert all(0 < row["service"][1] <= row["service"][0] for row in rows)
    run = found["soak"]
    assert (len(run["steps"]), run["errors"], run["sessions_left"]) == (3, [], 0)
    assert min(run["steps"]) > 0
    assert 0.3 < run["fairness"] <= 1
