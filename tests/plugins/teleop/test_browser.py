"""The page: who is let in, what it sends and is shown, and a session that it drives."""

import http.client
import io
import json
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import anysim
from anysim.errors import TaskError
from anysim.record.names import trajectories
from anysim.record.replay import replay
from anysim.testing.engines import require_drawing
from anysim_teleop.browser import SILENCE, BrowserDevice
from anysim_teleop.device import Button, Job, Moment
from anysim_teleop.keys import BUTTONS, HELP, MOTIONS
from anysim_teleop.page_server import LARGEST
from anysim_teleop.session import Session, Setup

JOB = Job("task", "", "null", ("arm.tool",), 0.02, 0.2, 1.0)
NOW = Moment(0, 1, False, 0.0)


class Page:
    """A browser that is on the page."""

    def __init__(self, url: str) -> None:
        address, _, self.token = url.partition("/#")
        self.port = int(address.rpartition(":")[2])

    def ask(self, method: str, path: str, body: Any = None, **headers: str) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
        try:
            whole = {"Authorization": f"Bearer {self.token}"} | {k.replace("_", "-"): v for k, v in headers.items()}
            data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
            connection.request(method, path, data, whole)
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def send(self, **keys: Any) -> dict[str, Any]:
        status, body = self.ask("POST", "/input", keys)
        assert status == 200, body
        return json.loads(body)


@pytest.fixture
def opened() -> Iterator[tuple[BrowserDevice, Page]]:
    with BrowserDevice() as device:
        device.open(JOB)
        yield device, Page(device.url)


def test_the_page_needs_no_token_and_holds_none(opened: tuple[BrowserDevice, Page]) -> None:
    _, page = opened
    for path, word in (("/", b"<!doctype html>"), ("/page.js", b"Bearer")):
        status, body = page.ask("GET", path, Authorization="")
        assert status == 200
        assert word in body
        assert page.token.encode() not in body


@pytest.mark.parametrize("token", ["", "Bearer ", "Bearer x", "Bearer \xe9"])
def test_without_the_token_nothing_is_shown_or_taken(token: str, opened: tuple[BrowserDevice, Page]) -> None:
    device, page = opened
    assert page.ask("GET", "/picture", Authorization=token)[0] == 401
    assert page.ask("POST", "/input", {"held": ["w"], "pressed": ["q"]}, Authorization=token)[0] == 401
    assert device.read(NOW).idle


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 421),
        ({"Host": "127.0.0.1"}, 421),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
    ],
)
def test_another_site_is_refused_even_with_the_token(
    headers: dict[str, str], status: int, opened: tuple[BrowserDevice, Page]
) -> None:
    device, page = opened
    assert page.ask("POST", "/input", {"held": ["w"]}, **headers)[0] == status
    if "Host" in headers:
        assert page.ask("GET", "/", **headers)[0] == status
    assert device.read(NOW).idle


def test_its_own_origin_is_let_in(opened: tuple[BrowserDevice, Page]) -> None:
    device, page = opened
    own = f"localhost:{page.port}"
    assert page.ask("POST", "/input", {"held": ["w"]}, Host=own, Origin=f"http://{own}")[0] == 200
    assert device.read(NOW).twist[0] > 0


@pytest.mark.parametrize(
    "body",
    [b"", b"{", {"held": "w"}, {"sticks": [2, 0, 0, 0, 0, 0]}, {"pose": 1}, {"held": ["w" * 99]}, b" " * (LARGEST + 1)],
    ids=range(7),
)
def test_what_is_no_input_is_refused(body: Any, opened: tuple[BrowserDevice, Page]) -> None:
    device, page = opened
    status, words = page.ask("POST", "/input", body)
    assert status == 400
    assert b"expected" in words
    assert device.read(NOW).idle
    assert page.ask("GET", "/else")[0] == 404


def test_keys_sticks_and_silence(opened: tuple[BrowserDevice, Page]) -> None:
    device, page = opened
    device.begin()
    assert device.read(NOW).idle
    page.send(held=["w"], pressed=["w", " ", "Enter"], sticks=[0, 1, 0, 0, 0, -0.5])
    asked = device.read(NOW)
    assert np.allclose(asked.twist, [0.1, 0.1, 0, 0, 0, -0.25])
    assert asked.closed is True
    assert asked.buttons == (Button.RECORD,)
    assert device.read(NOW).buttons == ()
    device.begin()
    assert device.read(NOW).idle, "what is held from the last episode does not move the next one"
    page.send(held=["w"], sticks=[0, 1, 0, 0, 0, 0])
    assert device.read(NOW).idle
    page.send(held=[])
    device.read(NOW)
    page.send(held=["r"], sticks=[0, 1, 0, 0, 0, 0])
    assert np.allclose(device.read(NOW).twist, [0, 0.1, 0.1, 0, 0, 0])
    time.sleep(SILENCE + 0.1)
    assert device.read(NOW).idle, "the page is gone, and the tool went on"


def test_the_page_is_shown_the_moment_and_the_picture(opened: tuple[BrowserDevice, Page]) -> None:
    device, page = opened
    picture = np.zeros((24, 32, 3), np.uint8)
    picture[:, :16] = [255, 0, 0]
    device.read(NOW._replace(picture=picture, success={"at_goal": True}, total=2.5))
    device.tell("episode 0: success")
    state = page.send()
    assert state["picture"] == 1
    assert "at_goal:yes" in state["line"]
    assert "return 2.50" in state["line"]
    assert state["told"] == ["episode 0: success"]
    status, body = page.ask("GET", "/picture")
    assert status == 200
    with Image.open(io.BytesIO(body)) as image:
        assert image.format == "JPEG"
        assert image.size == (32, 24)
        assert np.array(image)[12, 4, 0] > 200 > 100 > np.array(image)[12, 28, 0]


def test_a_port_that_is_taken_is_told_and_a_closed_one_is_free(opened: tuple[BrowserDevice, Page]) -> None:
    device, page = opened
    with pytest.raises(TaskError, match=f"port {page.port}.*-D port=N"), BrowserDevice(port=page.port) as other:
        other.open(JOB)
    device.close()
    with BrowserDevice(port=page.port) as again:
        again.open(JOB)
        assert Page(again.url).token != page.token


def test_the_page_and_the_terminal_have_the_same_keys() -> None:
    text = files("anysim_teleop").joinpath("page.html").read_text("utf-8")
    for words in ("w/s a/d r/f", "u/o i/k j/l", "backspace: begin again", "x: discard", "enter: start"):
        assert words in text
        assert any(words in line for line in HELP)
    script = files("anysim_teleop").joinpath("page.js").read_text("utf-8")
    assert all(f'"{key}"' in script for key in BUTTONS if key != "q")
    assert len(MOTIONS) == 18


BROWSER = """
const [base, token] = process.argv[1].split("/#");
const listeners = {}, elements = {}, real = fetch;
const pad = { axes: [0, 0.05, -1, 0], buttons: [{ value: 1 }] };
const stubs = {
  location: { hash: "#" + token },
  document: { getElementById: (name) => (elements[name] ??= {}) },
  navigator: { getGamepads: () => [null, pad] },
  addEventListener: (name, listener) => { listeners[name] = listener; },
  fetch: (path, options) => real(base + path, options),
  URL: { createObjectURL: (blob) => "blob:" + blob.size, revokeObjectURL: () => {} },
};
new Function(...Object.keys(stubs), require("fs").readFileSync(0, "utf8"))(...Object.values(stubs));
const key = (name, repeat) => ({ key: name, repeat, preventDefault() {} });
listeners.keydown(key("W", false));
listeners.keydown(key("W", true));
listeners.keydown(key("d", false));
listeners.keyup(key("d", false));
setTimeout(() => { console.log(JSON.stringify(elements)); process.exit(); }, 1000);
"""
"""A browser as far as the page's script needs one: two keys go down, one of them up; a gamepad turns and grips."""


@pytest.mark.skipif(shutil.which("node") is None, reason="no node to run the page's script with")
def test_the_script_of_the_page_sends_what_is_held_and_shows_what_comes_back(
    opened: tuple[BrowserDevice, Page],
) -> None:
    device, page = opened
    device.begin()
    device.read(NOW._replace(picture=np.zeros((8, 8, 3), np.uint8)))
    script = files("anysim_teleop").joinpath("page.js").read_bytes()
    done = subprocess.run(
        ["node", "-e", BROWSER, device.url], input=script, capture_output=True, timeout=30, check=True
    )
    asked = device.read(NOW)
    assert np.allclose(asked.twist, [0.1, 0, 0, 0, 0, 0.5])
    assert asked.closed is True, "a button of the gamepad that stays down is pressed once"
    shown = json.loads(done.stdout)
    assert "episode 1/1" in shown["line"]["textContent"]
    assert shown["trouble"]["textContent"] == ""
    assert shown["picture"]["src"] == f"blob:{len(page.ask('GET', '/picture')[1])}"


@pytest.mark.slow
def test_a_session_driven_by_the_page(tmp_path: Path) -> None:
    """It moves the tool up, sees the camera's picture, ends the episode, and that replays to the bit."""
    require_drawing("mujoco")
    device = BrowserDevice()
    more = ["record.cameras=[]", "record.keep=all", "world.cameras.front.size=[64,48]"]
    pictures: list[bytes] = []

    def browse() -> None:
        page = Page(device.url)
        for turn in range(30):
            state = page.send(held=["r"] if turn else [])
            if state["picture"]:
                pictures.append(page.ask("GET", "/picture")[1])
            time.sleep(0.03)
        page.send(pressed=["Enter"])

    with anysim.make("pick_cube", engine="mujoco", num_envs=1, overrides=more) as env:
        with pytest.raises(TaskError, match=r"no camera 'side'.*front.*--camera"):
            Session(env, BrowserDevice(), tmp_path / "x", 1, 0, Setup("browser", camera="side"))
        with Session(env, device, tmp_path, 1, 0, Setup("browser", camera="front")) as session:
            visitor = threading.Thread(target=browse)
            visitor.start()
            [result] = session.run()
            visitor.join()
        lifted = env.scene.frame("panda.tool").position[0, 2]
    assert result.status == "truncated"
    assert lifted > 0.6
    assert len({bytes(p) for p in pictures}) > 1
    assert trajectories(tmp_path) == [result.path]
    assert result.path is not None
    assert replay(result.path).identical
