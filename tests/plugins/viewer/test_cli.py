"""`anysim view`: what it refuses, in words, and how it ends."""

import re
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from anysim.errors import AnysimError


def refused(command_line: Any, *words: str) -> str:
    ran = CliRunner().invoke(command_line, ["view", *words])
    assert ran.exit_code != 0
    assert isinstance(ran.exception, AnysimError), ran.output
    return str(ran.exception)


def test_bad_input_is_told_in_a_sentence(command_line: Any, tmp_path: Path) -> None:
    assert "did you mean" in refused(command_line, "pick_cub").lower() or "pick_cube" in refused(
        command_line, "pick_cub"
    )
    assert "holds no trajectory" in refused(command_line, str(tmp_path))
    assert "there is nothing at runs/none" in refused(command_line, "runs/none")
    assert "are for tasks and worlds" in refused(command_line, str(tmp_path), "--num-envs", "2")
    assert "needs a token" in refused(command_line, "pick_cube", "--host", "0.0.0.0", "--no-token")
    bad = tmp_path / "bad.yaml"
    bad.write_text("world: {objects: 3}\n")
    assert f"{bad}:1" in refused(command_line, str(bad))


def test_a_port_that_is_taken_is_told(command_line: Any, tmp_path: Path) -> None:
    world = tmp_path / "ball.yaml"
    world.write_text("engine: 'null'\nworld: {objects: {ball: {source: {sphere: 0.1}, mass: 1.0}}}\n")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert f"127.0.0.1:{port}" in refused(command_line, str(world), "--port", port)


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_when_it_is_told(tmp_path: Path, number: signal.Signals) -> None:
    world = tmp_path / "ball.yaml"
    world.write_text("engine: 'null'\nworld: {objects: {ball: {source: {sphere: 0.1}, mass: 1.0}}}\n")
    command = [sys.executable, "-u", "-m", "anysim.cli", "view", str(world), "--port", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=tmp_path
    ) as process:
        assert process.stdout is not None
        first = process.stdout.readline()
        assert re.fullmatch(r"viewing ball on null \S+, seed 0: http://127\.0\.0\.1:\d+/\?token=\S{32}\n", first), first
        assert process.stdout.readline() == "Ctrl-C ends it\n"
        process.send_signal(number)
        assert process.wait(60) == 0
        assert process.stdout.read() == "ended\n"
