"""Answers of a service over HTTP: what it says, to whom, and within which limits."""

import http.client
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError, TaskError
from anysim.task.snapshot import EnvSnapshot
from anysim_client.errors import ConnectionLost, ForbiddenSource, LimitExceeded, SessionGone, SessionTaken, Unauthorized
from anysim_client.token import keep_token, kept_token, token_file
from anysim_client.websocket import HandshakeRefusal, WebSocket
from anysim_serving.catalogue import Catalogue
from anysim_serving.server import Service, serving
from anysim_serving.settings import Limits, Settings
from tests.plugins.serving.helpers import BLOCKS, connected, local, same, service

LIMITS = Limits(sessions=3, envs=4, total_envs=6, linger_s=0.2, body_bytes=4096)


@pytest.fixture(scope="module")
def made() -> Iterator[Service]:
    with service(limits=LIMITS) as one:
        yield one


def ask(made: Service, path: str, method: str = "GET", body: Any = None, **headers: str) -> tuple[int, Any]:
    """The status and the JSON (or the bytes) of a request; with the token unless told otherwise."""
    named = {"Authorization": f"Bearer {made.settings.token}"} | {k.replace("_", "-"): v for k, v in headers.items()}
    link = http.client.HTTPConnection("127.0.0.1", made.settings.port, timeout=60)
    if body is not None and not isinstance(body, bytes):
        body, named = json.dumps(body).encode(), {"Content-Type": "application/json"} | named
    link.request(method, path, body, {name: value for name, value in named.items() if value})
    answer = link.getresponse()
    content = answer.read()
    link.close()
    return answer.status, json.loads(content) if content and "json" in answer.headers.get(
        "content-type", ""
    ) else content


# ------------------------------------------------------------------ who may ask


@pytest.mark.parametrize(
    ("headers", "status", "kind"),
    [
        ({"Authorization": ""}, 401, "Unauthorized"),
        ({"Authorization": "Bearer wrong"}, 401, "Unauthorized"),
        ({"Authorization": "Basic {token}"}, 401, "Unauthorized"),
        ({"Authorization": "Bearer {token}x"}, 401, "Unauthorized"),
        ({"Host": "evil.example"}, 403, "ForbiddenSource"),
        ({"Host": "127.0.0.1.evil.example:80"}, 403, "ForbiddenSource"),
        ({"Host": "127.0.0.1@evil.example"}, 403, "ForbiddenSource"),
        ({"Origin": "https://evil.example"}, 403, "ForbiddenSource"),
        ({"Origin": "null"}, 403, "ForbiddenSource"),
        ({"Host": "localhost:1"}, 200, ""),
        ({"Host": "[::1]"}, 200, ""),
    ],
)
@pytest.mark.parametrize("path", ["/v1/health", "/openapi.json"])
def test_who_may_ask(made: Service, path: str, headers: dict[str, str], status: int, kind: str) -> None:
    filled = {name: value.replace("{token}", made.settings.token) for name, value in headers.items()}
    got, answer = ask(made, path, **filled)
    assert got == status
    assert kind == "" or answer["error"]["type"] == kind


def test_a_socket_is_behind_the_same_checks(made: Service) -> None:
    def shake(headers: dict[str, str]) -> int:
        with pytest.raises(HandshakeRefusal) as refused:
            WebSocket.open(
                "127.0.0.1",
                made.settings.port,
                "/v1/sessions/none/socket",
                headers,
                context=None,
                timeout=30,
                largest=1000,
            )
        assert "error" in json.loads(refused.value.body)
        return refused.value.status

    right = {"Authorization": f"Bearer {made.settings.token}"}
    assert shake({}) == 401
    assert shake(right | {"Origin": "https://evil.example"}) == 403
    assert shake(right) == 404


def test_the_client_is_told_what_is_wrong(made: Service) -> None:
    with pytest.raises(Unauthorized, match="token is missing or wrong"):
        anysim.connect(made.address, token="wrong")
    with pytest.raises(ConnectionLost, match="no service answers"):
        anysim.connect("http://127.0.0.1:1", token="x")


def test_a_token_is_needed_beyond_loopback() -> None:
    with pytest.raises(TaskError, match="needs a token"):
        Settings(host="0.0.0.0")
    assert Settings().on_loopback


def test_without_a_token_loopback_is_open() -> None:
    with serving(BLOCKS, settings=Settings(hosts=("sim.lab",))) as one, anysim.connect(one.address) as env:
        assert env.num_envs == 1
        assert ask(one, "/v1/health", Host="sim.lab:80")[0] == 200


def test_the_token_is_kept_for_the_user_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANYSIM_STATE_DIR", str(tmp_path))
    path = keep_token("http://127.0.0.1:8470", "secret")
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700
    assert kept_token("http://localhost:8470") == "secret"
    assert kept_token("http://127.0.0.1:8471") == ""
    assert kept_token("http://10.0.0.1:8470") == ""  # nobody else is sent it
    path.chmod(0o644)
    assert kept_token("http://127.0.0.1:8470") == ""
    path.unlink()
    (tmp_path / "elsewhere").write_text(json.dumps({"address": "http://127.0.0.1:8470", "token": "planted"}))
    (tmp_path / "elsewhere").chmod(0o600)
    path.symlink_to(tmp_path / "elsewhere")
    assert kept_token("http://127.0.0.1:8470") == ""
    assert token_file("http://127.0.0.1:8470") == path


# ------------------------------------------------------------------ what may be asked for


def test_the_catalogue_says_what_there_is(made: Service) -> None:
    status, answer = ask(made, "/v1/catalogue")
    assert (status, answer["tasks"], answer["limits"]["envs"]) == (200, ["blocks"], 4)
    paths = ask(made, "/openapi.json")[1]["paths"]
    assert {"/v1/sessions", "/v1/sessions/{session}/reset", "/v1/metrics"} <= set(paths)


@pytest.mark.parametrize(
    ("request_", "status", "words"),
    [
        ({"task": "/etc/passwd"}, 403, "not served"),
        ({"task": "../blocks"}, 403, "not served"),
        ({"task": "pick_cube"}, 403, "not served"),
        ({"engine": "/tmp/engine"}, 403, "chosen by their name"),
        ({"robot": "../../robot"}, 403, "chosen by their name"),
        ({"overrides": ["world.objects.red.source.mesh=/etc/passwd"]}, 403, "cannot set"),
        ({"overrides": ["task.horizon=/etc/passwd"]}, 403, "cannot set"),
        ({"overrides": ["task.horizon=[1]"]}, 403, "cannot set"),
        ({"overrides": ["task.horizon=never"]}, 422, "task.horizon"),
        ({"num_envs": 5}, 413, "at most 4 envs"),
        ({"num_envs": 0}, 422, "num_envs"),
        ({"path": "x"}, 422, "path"),
        ({"task": "x" * 300}, 422, "task"),
    ],
)
def test_what_is_refused(made: Service, request_: dict[str, Any], status: int, words: str) -> None:
    got, answer = ask(made, "/v1/sessions", "POST", request_)
    assert got == status
    assert words in answer["error"]["message"]
    assert not made.app.state.sessions.open


def test_faults_of_a_spec_keep_their_issues(made: Service) -> None:
    with pytest.raises(SpecError) as raised:
        connected(made, overrides=["task.horizon=never"])
    assert raised.value.issues[0].path == "task.horizon"


def test_every_installed_task_where_the_owner_says_so() -> None:
    catalogue = Catalogue.of([BLOCKS], all_tasks=True)
    assert catalogue.names()[0] == "blocks"
    assert "reach" in catalogue.names()
    with pytest.raises(TaskError, match="called 'blocks'"):
        Catalogue.of([BLOCKS, BLOCKS])


def test_a_body_is_bounded(made: Service) -> None:
    status, answer = ask(made, "/v1/sessions", "POST", {"overrides": ["x" * 5000]})
    assert (status, answer["error"]["type"]) == (413, "LimitExceeded")

    def endless() -> Iterator[bytes]:
        for _ in range(100):
            yield b"x" * 100

    link = http.client.HTTPConnection("127.0.0.1", made.settings.port, timeout=60)
    headers = {"Authorization": f"Bearer {made.settings.token}", "Content-Type": "application/json"}
    link.request("POST", "/v1/sessions", endless(), headers, encode_chunked=True)
    assert link.getresponse().status == 413
    link.close()


# ------------------------------------------------------------------ sessions


def test_a_session_over_http(made: Service, tmp_path: Path) -> None:
    status, session = ask(made, "/v1/sessions", "POST", {"num_envs": 2})
    assert status == 201
    path, key = f"/v1/sessions/{session['id']}", {"Anysim-Session-Key": session["key"]}
    assert session["spec"]["observations"] == {"policy": 10, "privileged": 3}
    assert ask(made, f"{path}/spec", **key)[1] == session["spec"]
    with local(num_envs=2) as near:
        near.reset(seed=3)
        status, answer = ask(made, f"{path}/reset", "POST", {"seed": 3}, **key)
        assert status == 200
        assert same(np.array(answer["obs"]["policy"], np.float32), near.obs["policy"])
        status, content = ask(made, f"{path}/snapshot", "POST", b"", **key)
        (tmp_path / "envs").write_bytes(content)
        assert EnvSnapshot.load(tmp_path / "envs").streams == near.snapshot().streams
        ask(made, f"{path}/reset", "POST", {"env_ids": [1]}, **key)
        binary = {"Content-Type": "application/octet-stream"} | key
        status, answer = ask(made, f"{path}/reset_to", "POST", content, **binary)
        assert (status, answer["obs"]["policy"]) == (200, near.obs["policy"].tolist())
        status, answer = ask(made, f"{path}/reset_to", "POST", content[:-9], **binary)
        assert (status, answer["error"]["type"]) == (422, "SnapshotError")
        assert "/tmp" not in answer["error"]["message"]
        told = ask(made, f"{path}/info", **key)[1]["details"]
        assert told[0]["draws"] == near.streams.draws[0]
    assert ask(made, path, **key)[1]["num_envs"] == 2
    assert ask(made, f"{path}/reset", "POST", {"env_ids": [7]}, **key)[0] == 400
    assert "anysim_envs 2" in ask(made, "/v1/metrics")[1].decode()
    assert ask(made, path, "DELETE", **key)[0] == 204
    assert ask(made, path, **key)[0] == 404


def test_a_session_belongs_to_who_has_its_key(made: Service) -> None:
    with connected(made) as env:
        shown = ask(made, "/v1/sessions")[1]
        assert shown[0]["id"] == env.link.id
        assert env.link._key not in json.dumps(shown)
        path = f"/v1/sessions/{env.link.id}"
        for key in ({}, {"Anysim-Session-Key": "wrong"}):
            assert ask(made, path, "DELETE", **key)[0] == 404
            assert ask(made, f"{path}/reset", "POST", {}, **key)[0] == 404
        env.reset(seed=0)


def test_sessions_and_envs_are_limited(made: Service) -> None:
    with connected(made, num_envs=4), connected(made, num_envs=2):
        with pytest.raises(LimitExceeded, match="6 of 6 envs are taken"):
            connected(made)
        with pytest.raises(ForbiddenSource, match="not served"):
            connected(made, task="nothing")
    with connected(made), connected(made), connected(made), pytest.raises(LimitExceeded, match="3 sessions"):
        connected(made)


def test_renders_chunks_and_messages_are_limited() -> None:
    with service(limits=Limits(pixels=1000, chunk=4, message_bytes=10000)) as small, connected(small) as env:
        env.reset(seed=0)
        with pytest.raises(LimitExceeded, match="at most 1000 pixels"):
            env.render(size=(64, 64))
        with pytest.raises(LimitExceeded, match="at most 4 steps"):
            env.step_chunk(np.zeros((1, 5, 0)))
        with pytest.raises(ConnectionLost):
            env.step(np.zeros((1, 20000)))


def test_two_clients_cannot_have_one_session(made: Service) -> None:
    with connected(made) as env:
        env.reset(seed=0)
        with pytest.raises(SessionTaken, match="another connection"):
            type(env.link).attach(_copy(env.link))
        env.step(np.zeros((1, 0)))


def test_an_ended_session_is_gone(made: Service) -> None:
    env = connected(made)
    link = _copy(env.link)
    env.close()
    with pytest.raises(SessionGone):
        link.attach()
    with pytest.raises(ConnectionLost, match="closed"):
        env.reset()


def _copy(link: Any) -> Any:
    """A link that knows what another one knows: a replayed session."""
    again = object.__new__(type(link))
    again.__dict__.update(link.__dict__)
    again._socket = None
    return again
