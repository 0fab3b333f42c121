"""OpenEnv's protocol: an episode over the wire and, where it is installed, by OpenEnv's own client."""

import base64
import importlib.util
import json
from collections.abc import Iterator
from typing import Any
from urllib.request import Request, urlopen

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import anysim
from anysim.testing.engines import require_engine
from anysim_adapters.openenv.server import serving_openenv
from anysim_serving.settings import Limits, Settings

OVERRIDES = ("record.cameras=[]", "task.horizon=4")


@pytest.fixture(scope="module")
def service() -> Iterator[Any]:
    require_engine("mujoco")
    settings = Settings(token="secret", limits=Limits(sessions=2))
    with serving_openenv("reach", settings, engine="mujoco", overrides=OVERRIDES) as running:
        yield running


def headers(token: str = "secret") -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


@pytest.fixture
def socket(service: Any) -> Iterator[Any]:
    with connect(service.address.replace("http", "ws") + "/ws", additional_headers=headers()) as opened:
        yield opened


def ask(socket: Any, kind: str, **data: Any) -> Any:
    socket.send(json.dumps({"type": kind, "data": data}))
    return json.loads(socket.recv(timeout=60))


def test_an_episode_is_that_of_a_local_env(socket: Any) -> None:
    begun = ask(socket, "reset", seed=3, episode_id="one")
    assert begun["type"] == "observation"
    assert begun["data"]["reward"] is None
    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=OVERRIDES) as env:
        env.reset(seed=[3])
        assert begun["data"]["observation"]["policy"] == env.obs["policy"][0].tolist()
        assert begun["data"]["observation"]["instruction"] == env.instruction(0)
        assert "privileged" not in begun["data"]["observation"]
        action = np.linspace(-0.5, 0.5, env.action_dim)
        for _ in range(4):
            stepped = ask(socket, "step", action=action.tolist())["data"]
            local = env.step(action[None])
            assert stepped["reward"] == float(local.reward[0])
            assert stepped["observation"]["policy"] == env.obs["policy"][0].tolist()
        assert stepped["done"]
        assert stepped["metadata"]["truncated"]
        state = ask(socket, "state")["data"]
        assert (state["episode_id"], state["step_count"]) == ("one", 4)
        assert len(state["action"]["names"]) == env.action_dim
    again = ask(socket, "step", action=action.tolist())
    assert again["type"] == "error"
    assert "send reset first" in again["data"]["message"]
    assert ask(socket, "reset")["type"] == "observation"
    state = ask(socket, "state")["data"]
    assert (state["episode_id"], state["step_count"]) == (None, 0)
    assert ask(socket, "step", action=action.tolist())["type"] == "observation"
    assert ask(socket, "state")["data"]["step_count"] == 1


def test_what_is_wrong_is_said_and_the_session_goes_on(socket: Any) -> None:
    assert ask(socket, "state")["data"]["step_count"] == 0
    ask(socket, "reset", seed=1)
    for message, code in (
        ("{", "INVALID_JSON"),
        ("[1]", "INVALID_JSON"),
        (json.dumps({"type": "step", "data": [1]}), "INVALID_JSON"),
        (json.dumps({"type": "run"}), "UNKNOWN_TYPE"),
        (json.dumps({"type": "step", "data": {"action": [1.0]}}), "VALIDATION_ERROR"),
        (json.dumps({"type": "step", "data": {"action": [float("nan")] * 8}}), "VALIDATION_ERROR"),
        (json.dumps({"type": "step", "data": {"action": [0.0] * 8, "file": "/"}}), "VALIDATION_ERROR"),
        (json.dumps({"type": "reset", "data": {"seed": "one"}}), "VALIDATION_ERROR"),
        (json.dumps({"type": "reset", "data": {"file": "/etc"}}), "VALIDATION_ERROR"),
    ):
        socket.send(message)
        answer = json.loads(socket.recv(timeout=60))
        assert (answer["type"], answer["data"]["code"]) == ("error", code), message
    assert ask(socket, "step", action=[0.0] * 8)["type"] == "observation"


def test_the_token_and_the_number_of_sessions(service: Any, socket: Any) -> None:
    url = service.address.replace("http", "ws") + "/ws"
    with pytest.raises(InvalidStatus, match="401"), connect(url, additional_headers=headers("wrong")):
        pass
    with connect(url, additional_headers=headers()) as second:
        ask(second, "reset")
        with connect(url, additional_headers=headers()) as third:
            refused = json.loads(third.recv(timeout=60))
            assert (refused["type"], refused["data"]["code"]) == ("error", "CAPACITY_REACHED")
    for path, key in (("health", "status"), ("metadata", "name"), ("schema", "action")):
        with urlopen(Request(f"{service.address}/{path}", headers=headers())) as answer:
            assert json.load(answer)[key]


def test_images_travel_as_png() -> None:
    from anysim_adapters.openenv.app import _image  # pyright: ignore[reportPrivateUsage]

    pixels = np.random.default_rng(0).integers(0, 255, (6, 4, 3), dtype=np.uint8)
    found = _image(pixels)
    assert base64.b64decode(found["data"]).startswith(b"\x89PNG")
    depth = np.linspace(0, 1, 6, dtype=np.float32).reshape(2, 3)
    raw = _image(depth)
    back = np.frombuffer(base64.b64decode(raw["data"]), raw["dtype"]).reshape(raw["shape"])
    assert np.array_equal(back, depth)


@pytest.mark.skipif(importlib.util.find_spec("openenv") is None, reason="needs openenv: make test-openenv")
@pytest.mark.filterwarnings("ignore")  # those of openenv and what it imports
def test_its_own_client_completes_an_episode(service: Any) -> None:
    from openenv.core.generic_client import GenericEnvClient  # pyright: ignore[reportMissingImports]

    with GenericEnvClient(base_url=service.address, headers=headers()).sync() as client:
        result = client.reset(seed=5)
        steps = 0
        while not result.done:
            result = client.step({"action": [0.0] * 8})
            assert isinstance(result.reward, float)
            steps += 1
        assert steps == 4
        assert client.state()["step_count"] == 4
        with pytest.raises(RuntimeError, match="VALIDATION_ERROR"):
            client.step({"action": [0.0] * 3})
        assert not client.reset().done
