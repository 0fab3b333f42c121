"""The keyboard: keys as terminals send them, and a session in a terminal that is put back as it was."""

import os
import pty
import re
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim_teleop.device import Button, Job, Moment
from anysim_teleop.keyboard import KeyboardDevice, keys_of
from anysim_teleop.keys import KeyControl

JOB = Job("task", "", "null", ("arm.tool",), 0.02, 0.2, 1.0)
NOW = Moment(0, 1, False, 0.0)


def test_bytes_of_a_terminal_are_keys() -> None:
    found = keys_of(b"w\x1b[A\x1b[5~\n\t \x7f\x1bOD?")
    assert "|".join(found) == "w|ArrowUp|PageUp|Enter|Tab| |Backspace|ArrowLeft|?"


def test_keys_ask_for_motion_speed_axes_grip_and_buttons() -> None:
    control = KeyControl(JOB)
    assert np.allclose(control.take(NOW, ["w", "d", "r"]).twist, [0.1, -0.1, 0.1, 0, 0, 0])
    assert not control.take(NOW, ["w", "s"]).twist.any()
    assert np.allclose(control.take(NOW, ["j"]).twist, [0, 0, 0, 0, 0, 0.5])
    for key in (*"++++", "t", " ", "Enter", "x"):
        assert control.press(key)
    asked = control.take(NOW, ["w"])
    assert asked.twist[0] == pytest.approx(0.2)
    assert (asked.frame, asked.closed) == ("tool", True)
    assert asked.buttons == (Button.RECORD, Button.DISCARD)
    again = control.take(NOW, [])
    assert again.idle
    assert not control.press("z")
    control.press("q")
    control.forget()
    assert control.take(NOW, []).idle
    assert "tool axes, 100 % speed" in control.line(NOW)


@contextmanager
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[int, int]]:
    """The two ends of a terminal that this process has for its input and output."""
    master, slave = pty.openpty()
    with os.fdopen(os.dup(slave)) as stdin, os.fdopen(os.dup(slave), "w") as stdout:
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stdin", stdin)
            patch.setattr(sys, "stdout", stdout)
            yield master, slave
    os.close(master)
    os.close(slave)


def test_a_key_acts_as_long_as_it_repeats_and_not_into_the_next_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    with terminal(monkeypatch) as (master, slave), KeyboardDevice(hold=0.1) as device:
        before = termios.tcgetattr(slave)
        device.open(JOB)
        assert not termios.tcgetattr(slave)[3] & (termios.ECHO | termios.ICANON)
        device.begin()
        os.write(master, b"w")
        time.sleep(0.01)
        assert device.read(NOW).twist[0] > 0
        device.begin()
        os.write(master, b"w")
        time.sleep(0.01)
        assert device.read(NOW).idle, "it was held from the last episode on"
        os.write(master, b"a")
        time.sleep(0.01)
        assert device.read(NOW).twist[:2].tolist() == [0.0, 0.1]
        time.sleep(0.12)
        assert device.read(NOW).idle
        device.close()
        assert termios.tcgetattr(slave) == before


def test_without_a_terminal_it_says_what_is_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with (tmp_path / "empty").open("w+") as file:
        monkeypatch.setattr(sys, "stdin", file)
        with pytest.raises(TaskError, match="needs a terminal"):
            KeyboardDevice().open(JOB)


class Typist:
    """A process in a terminal, what it has said, and keys for it."""

    def __init__(self, command: list[str], cwd: Path) -> None:
        self.master, self.slave = pty.openpty()
        self.before = termios.tcgetattr(self.slave)
        self.said = ""
        environment = os.environ | {"TERM": "xterm", "COLUMNS": "200"}
        # a session of its own, with this terminal, so that Ctrl-C reaches it and nothing else
        start = (
            "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); os.execv(sys.argv[1], sys.argv[1:])"
        )
        whole = [sys.executable, "-c", start, sys.executable, *command]
        end = self.slave
        self.process = subprocess.Popen(
            whole, cwd=cwd, env=environment, start_new_session=True, stdin=end, stdout=end, stderr=end
        )
        self._reader = threading.Thread(target=self._read)
        self._stop = threading.Event()
        self._reader.start()

    def _read(self) -> None:
        os.set_blocking(self.master, False)
        while not self._stop.is_set():
            try:
                self.said += os.read(self.master, 4096).decode(errors="replace")
            except BlockingIOError:
                time.sleep(0.005)

    def wait_for(self, pattern: str, keys: bytes = b"", seconds: float = 60.0) -> None:
        """Type keys again and again until it says something, which matches a pattern, that it has not said before."""
        start, end = len(self.said), time.monotonic() + seconds
        while not re.search(pattern, self.said[start:]):
            assert time.monotonic() < end, f"never said {pattern!r}: {self.said[-2000:]}"
            assert self.process.poll() is None, self.said[-2000:]
            os.write(self.master, keys)
            time.sleep(0.03)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self._stop.set()
        self._reader.join()
        os.close(self.master)
        os.close(self.slave)


@pytest.mark.slow
def test_a_session_in_a_terminal(tmp_path: Path) -> None:
    """Discard, keep, break off: one trajectory is left, with the motion of its keys, and the terminal is as it was."""
    options = "--out run -k 3 -o record.cameras=[] -o record.keep=all"
    typist = Typist(["-m", "anysim.cli", "teleop", "pick_cube", *options.split()], tmp_path)
    try:
        typist.wait_for("episode 1/3 . waiting")
        typist.wait_for(r"\| +(0\.[2-9]|[1-9])", b"a")
        os.write(typist.master, b"x")
        typist.wait_for("episode 2/3 . waiting")
        typist.wait_for(r"\| +(0\.[6-9]|[1-9])", b"r")
        os.write(typist.master, b"\n")
        typist.wait_for("episode 3/3 . waiting")
        typist.wait_for(r"\| +(0\.[2-9]|[1-9])", b"w")
        os.write(typist.master, b"\x03")
        typist.process.wait(20)
        time.sleep(0.1)
        after = termios.tcgetattr(typist.slave)
    finally:
        typist.close()
    assert typist.process.returncode == 130, typist.said
    assert after == typist.before
    [kept] = trajectories(tmp_path / "run")
    assert {path.name for path in (tmp_path / "run").iterdir()} == {"run.json", "episodes"}
    reader = open_trajectory(kept)
    assert reader.manifest.episode == 1
    assert reader.manifest.outcome["device"] == "keyboard"
    links = [i for i, name in enumerate(reader.manifest.layout.bodies) if name.startswith("panda.")]
    height = reader.states["body_pose"][:, links, 2]
    assert (height[-1] - height[0]).max() > 0.02
    assert replay(kept).identical
