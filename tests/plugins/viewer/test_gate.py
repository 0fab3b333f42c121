"""The gate of the page: who may see it, whatever the server inside would let in."""

import socket
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request as Asking, urlopen

import pytest
from websockets import Headers
from websockets.http11 import Request

from anysim.errors import TaskError
from anysim_viewer.gate import Access, Gate
from anysim_viewer.page import Page

TOKEN = "a-token-of-a-test"


@pytest.fixture(scope="module")
def gate() -> Any:
    made = Gate(Access(token=TOKEN))
    yield made
    made.close()


def request(gate: Gate, path: str = "/", **headers: str) -> Request:
    given = {"Host": f"127.0.0.1:{gate.port}", **{key.replace("_", "-"): value for key, value in headers.items()}}
    return Request(path, Headers(given))


def cookie(gate: Gate, token: str = TOKEN) -> str:
    return f"other=1; anysim_view_{gate.port}={token}"


def test_the_token_of_the_address_becomes_a_cookie(gate: Gate) -> None:
    answer = gate.check(request(gate, f"/?token={TOKEN}"))
    assert answer is not None
    assert (answer.status_code, answer.headers["Location"]) == (HTTPStatus.SEE_OTHER, "/")
    kept = answer.headers["Set-Cookie"]
    assert "HttpOnly" in kept
    assert "SameSite=Strict" in kept
    assert gate.check(request(gate, Cookie=kept.partition(";")[0])) is None


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/index.html", f"/#token={TOKEN}"])
def test_without_the_token_nothing_is_seen(gate: Gate, path: str) -> None:
    for more in ({}, {"Upgrade": "websocket"}, {"Cookie": cookie(gate, "wrong")}, {"Cookie": f"anysim_view_1={TOKEN}"}):
        answer = gate.check(request(gate, path, **more))
        assert answer is not None
        assert answer.status_code == HTTPStatus.UNAUTHORIZED
        assert b"open the address that was printed" in answer.body


def test_a_socket_does_not_take_the_token_from_its_address(gate: Gate) -> None:
    answer = gate.check(request(gate, f"/?token={TOKEN}", Upgrade="websocket"))
    assert answer is not None
    assert answer.status_code == HTTPStatus.UNAUTHORIZED


def test_other_sites_and_other_names_are_refused(gate: Gate) -> None:
    own = {"Cookie": cookie(gate)}
    for origin in (
        "http://evil.example",
        f"https://127.0.0.1:{gate.port}",
        "null",
        f"http://127.0.0.1:{gate.port + 1}",
    ):
        answer = gate.check(request(gate, Origin=origin, Upgrade="websocket", **own))
        assert answer is not None
        assert answer.status_code == HTTPStatus.FORBIDDEN
    for host in ("rebound.example", "", "127.0.0.1.evil.example", "0.0.0.0"):
        answer = gate.check(request(gate, Host=host, **own))
        assert answer is not None
        assert answer.status_code == HTTPStatus.MISDIRECTED_REQUEST
    assert gate.check(request(gate, Origin=f"http://127.0.0.1:{gate.port}", Upgrade="websocket", **own)) is None
    assert gate.check(request(gate, Host=f"localhost:{gate.port}", **own)) is None


def test_a_header_that_comes_twice_is_refused(gate: Gate) -> None:
    asked = request(gate, Cookie=cookie(gate))
    asked.headers["Host"] = "evil.example"
    answer = gate.check(asked)
    assert answer is not None
    assert answer.status_code == HTTPStatus.BAD_REQUEST


def test_names_can_be_allowed() -> None:
    gate = Gate(Access(token=TOKEN, hosts=("sim.lab",)))
    try:
        assert gate.check(request(gate, Host=f"Sim.Lab:{gate.port}", Cookie=cookie(gate))) is None
    finally:
        gate.close()


def test_other_machines_need_a_token(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match=r"a view on 0\.0\.0\.0 needs a token.*ssh -L"):
        Access(host="0.0.0.0")
    with pytest.raises(TaskError, match="--tls-certificate"):
        Access(key=tmp_path / "key.pem")
    with pytest.raises(TaskError, match="the TLS certificate or key cannot be used"):
        Gate(Access(token=TOKEN, certificate=tmp_path / "none.pem"))


def test_a_port_that_is_taken_is_told() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(TaskError, match=rf"cannot listen on 127\.0\.0\.1:{port}: .*--port"):
            Gate(Access(port=port, token=TOKEN))


def test_the_server_inside_asks_the_gate() -> None:
    page = Page(Access(token=TOKEN), "test")
    try:
        with pytest.raises(HTTPError) as refused:
            urlopen(page.address, timeout=30)
        assert refused.value.code == HTTPStatus.UNAUTHORIZED
        port = page.address.rsplit(":", 1)[1].strip("/")
        seen = Asking(page.address, headers={"Cookie": f"anysim_view_{port}={TOKEN}"})
        with urlopen(seen, timeout=30) as answer:
            policy = answer.headers["Content-Security-Policy"]
            assert b"<html" in answer.read()
        assert "frame-ancestors 'none'" in policy
        assert "http" not in policy.replace(f"http://127.0.0.1:{port}", "")
        assert page.server.request_share_url() is None
    finally:
        page.close()
