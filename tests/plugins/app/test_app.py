"""The local page: what it shows, what it starts, and who may ask."""

import http.client
import json
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlencode

import pytest

from anysim import registry
from anysim_app.found import entries
from anysim_app.page import serving_app
from anysim_app.programs import Programs
from anysim_serving.server import Service


@dataclass
class Visitor:
    """Someone who asks, with a browser's cookie or without."""

    service: Service
    cookie: str = ""

    def ask(self, path: str, form: dict[str, str] | None = None, **headers: str) -> tuple[int, dict[str, str], str]:
        """Status, headers and text of the answer; a form is posted."""
        port = self.service.settings.port
        link = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        sent = {"Cookie": self.cookie} if self.cookie else {}
        if form is not None:
            sent |= {"Content-Type": "application/x-www-form-urlencoded", "Origin": f"http://127.0.0.1:{port}"}
        sent |= {key.replace("_", "-"): value for key, value in headers.items()}
        try:
            link.request("GET" if form is None else "POST", path, None if form is None else urlencode(form), sent)
            answer = link.getresponse()
            told = {name.lower(): value for name, value in answer.getheaders()}
            return answer.status, told, answer.read().decode("utf-8", "replace")
        finally:
            link.close()


@contextmanager
def page(root: Path) -> Iterator[Visitor]:
    """The page over a folder, and one who has come by the printed address."""
    service, url = serving_app(root, 0)
    service.start()
    try:
        visitor = Visitor(service)
        status, headers, _ = visitor.ask("/" + url.partition(f"{service.settings.port}/")[2])
        assert (status, headers["location"]) == (303, "/")
        assert "HttpOnly" in headers["set-cookie"]
        assert "SameSite=Strict" in headers["set-cookie"]
        visitor.cookie = headers["set-cookie"].partition(";")[0]
        yield visitor
    finally:
        service.stop()


def recorded(root: Path) -> Path:
    """A run of two episodes, as a run directory has them, with a video and a page; and a link that leads out."""
    run = root / "reach-null"
    for number, status in enumerate(("success", "failed")):
        folder = run / "episodes" / f"env_0000_episode_000{number}"
        folder.mkdir(parents=True)
        told = {"env": 0, "episode": number, "status": status, "steps": 7 + number, "instruction": "<b>reach</b>"}
        (folder / "manifest.json").write_text(json.dumps(told))
        (folder / "front.mp4").write_bytes(b"a video")
        (folder / "trajectory.mcap").write_bytes(b"numbers")
    (run / "run.json").write_text(json.dumps({"task": "reach", "engine": "null", "seed": 3}))
    (run / "report.json").write_text(json.dumps({"attempts": 2, "successes": 1}))
    (run / "report.html").write_text("<p>a report</p>")
    (root / "secret.txt").write_text("secret")
    (run / "secret.html").symlink_to(root / "secret.txt")
    return run


def test_every_page_is_shown(tmp_path: Path) -> None:
    recorded(tmp_path)
    with page(tmp_path) as visitor:
        status, headers, text = visitor.ask("/")
        assert status == 200
        assert "default-src 'self'" in headers["content-security-policy"]
        assert all(f'href="/tasks/{name}"' in text for name in registry.names("tasks"))
        assert "reach-null" in text
        for path, words in (("/robots", "franka_panda"), ("/runs", "1 of 2 succeeded"), ("/programs", "Nothing was")):
            status, _, text = visitor.ask(path)
            assert status == 200
            assert words in text
        status, _, text = visitor.ask("/tasks/pick_cube")
        assert status == 200
        assert "Look at it live" in text
        assert "extends: ../tabletop.yaml" in text
        assert visitor.ask("/tasks/pick_cube/picture")[1]["content-type"] == "image/jpeg"
        [entry] = entries(tmp_path)
        status, _, text = visitor.ask(f"/runs/{entry.key}")
        assert status == 200
        assert text.count("<video") == 2
        assert "&lt;b&gt;reach" in text
        video = re.search(r'<video[^>]* src="([^"]+)"', text)
        assert video is not None
        assert visitor.ask(video[1])[2] == "a video"
        assert visitor.ask(f"/files/{entry.key}/report.html")[2] == "<p>a report</p>"


def test_who_has_not_come_by_the_address_sees_nothing_and_no_path_leads_out(tmp_path: Path) -> None:
    recorded(tmp_path)
    with page(tmp_path) as visitor:
        stranger, port = Visitor(visitor.service), visitor.service.settings.port
        assert stranger.ask("/")[0] == 401
        assert stranger.ask("/?token=wrong")[0] == 401
        assert stranger.ask("/", Cookie=f"anysim_app_{port}=wrong")[0] == 401
        assert stranger.ask("/", Authorization=f"Bearer {visitor.service.settings.token}")[0] == 401  # browsers alone
        assert visitor.ask("/", Host="evil.example")[0] == 403
        for origin in ("https://evil.example", f"http://127.0.0.1:{port + 1}", "null"):
            form = {"what": "view", "task": "reach", "engine": "null"}
            assert visitor.ask("/start", form, Origin=origin)[0] == 403
        assert visitor.ask("/start", {"what": "x" * (1 << 15)})[0] == 413
        [entry] = entries(tmp_path)
        for name in ("run.json", "secret.html", "../secret.txt", "%2e%2e/secret.txt", "episodes/../../secret.txt"):
            status, _, text = visitor.ask(f"/files/{entry.key}/{name}")
            assert status in (400, 404)
            assert "secret" not in text.replace("secret.html", "").replace("secret.txt", "")
        assert visitor.ask("/programs")[2].count("anysim view") == 0


def test_what_cannot_be_started_is_a_sentence(tmp_path: Path) -> None:
    with page(tmp_path) as visitor:
        for form, words in (
            ({"what": "view", "task": "pick_cub", "engine": "null"}, "did you mean &#39;pick_cube&#39;"),
            ({"what": "view", "task": "reach", "engine": "nul"}, "there is no engine"),
            ({"what": "rm", "task": "reach", "engine": "null"}, "nothing that can be started"),
            ({"what": "replay", "run": "../x"}, "there is no such run"),
        ):
            status, _, text = visitor.ask("/start", form)
            assert status == 400
            assert words in text
        assert visitor.ask("/runs/0123")[0] == 400
        assert visitor.ask("/programs/7")[0] == 400
        assert "none yet" in visitor.ask("/runs")[2]


def test_a_program_is_started_told_of_and_stopped(tmp_path: Path) -> None:
    programs = Programs()
    try:
        made = programs.start("list", "engines")
        end = time.monotonic() + 60
        while made.state == "running" and time.monotonic() < end:
            time.sleep(0.05)
        assert made.state == "done"
        assert programs.get(made.number) is made
        assert made.title == "anysim list engines"
        failing = programs.start("run", "no_such_task")
        failing.process.wait(60)
        assert failing.state.startswith("failed")
        assert programs.all() == [failing, made]
    finally:
        programs.close()
    while not any("null" in line for line in made.lines) and time.monotonic() < end:
        time.sleep(0.05)  # its thread reads on
    assert any("null" in line for line in made.lines)


@pytest.mark.slow
def test_a_run_is_recorded_from_the_page(tmp_path: Path) -> None:
    with page(tmp_path) as visitor:
        status, headers, _ = visitor.ask("/start", {"what": "run", "task": "reach", "engine": "mujoco"})
        assert status == 303
        end = time.monotonic() + 240
        while ">running<" in (text := visitor.ask(headers["location"])[2]) and time.monotonic() < end:
            time.sleep(0.5)
        assert ">done<" in text, text
        [entry] = entries(tmp_path)
        assert entry.name == "reach-mujoco-001"
        assert "4 episodes recorded" in visitor.ask(f"/runs/{entry.key}")[2]
