"""openpi's protocol: a served policy acts as it does here, over the wire and by openpi's own client."""

import importlib.util
from collections.abc import Iterator
from typing import Any
from urllib.request import urlopen

import msgpack
import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import anysim
from anysim.errors import TaskError
from anysim.testing.engines import require_engine
from anysim_adapters.openpi.host import PolicyHost
from anysim_adapters.openpi.server import serving_policy
from anysim_evaluation.driver import drive, episode_seeds
from anysim_evaluation.policy import make_policy
from anysim_policy import openpi_wire
from anysim_policy.openpi import KEY_ENV
from anysim_serving.settings import Settings

OVERRIDES = ("record.cameras=[]", "task.horizon=6")
WEIGHTS = np.random.default_rng(3).normal(0.0, 0.1, (3, 8, 64)).astype(np.float32)
HERE = "tests.plugins.adapters.test_openpi"


def leaning(obs: dict[str, np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
    """Chunks of three steps, by what is observed."""
    rows = obs["policy"].astype(np.float32)
    return np.tanh((rows[:, None, None, :] * WEIGHTS[:, :, : rows.shape[1]]).sum(-1))


def broken(obs: dict[str, np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
    raise RuntimeError("/somewhere/secret")


@pytest.fixture(scope="module")
def service() -> Iterator[Any]:
    require_engine("mujoco")
    settings = Settings(token="secret")
    with serving_policy(
        "reach",
        f"{HERE}:leaning",
        settings,
        engine="mujoco",
        overrides=OVERRIDES,
        keys="observation/state:policy",
        clients=2,
    ) as running:
        yield running


def url(service: Any) -> str:
    return service.address.replace("http", "ws")


def opened(service: Any, key: str = "secret", scheme: str = "Api-Key", **heads: str) -> Any:
    return connect(url(service), additional_headers={"Authorization": f"{scheme} {key}", **heads}, compression=None)


def asked(socket: Any, **seen: Any) -> Any:
    socket.send(openpi_wire.pack(seen))
    answer = socket.recv(timeout=60)
    return answer if isinstance(answer, str) else openpi_wire.unpack(answer)


def test_episodes_are_those_of_the_policy_here(service: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with anysim.make("reach", engine="mujoco", num_envs=2, overrides=list(OVERRIDES)) as env:
        seeds = episode_seeds("validation", 0, 3)
        here = sorted(drive(env, make_policy(env, f"{HERE}:leaning"), seeds), key=lambda episode: episode.seed)
        with pytest.raises(TaskError, match=rf"cannot be reached .*401.* or give its key in {KEY_ENV}"):
            make_policy(env, f"openpi:{url(service)}")
        monkeypatch.setenv(KEY_ENV, "secret")
        asking = make_policy(env, f"openpi:{url(service)},keys=observation/state:policy")
        assert asking.metadata["observations"] == {"observation/state": env.observation_sizes["policy"]}  # type: ignore[attr-defined]
        there = sorted(drive(env, asking, seeds), key=lambda episode: episode.seed)
        asking.close()  # type: ignore[attr-defined]
    assert there == here
    assert {episode.steps for episode in here} == {6}


def test_what_is_wrong_is_said_and_the_client_goes_on(service: Any) -> None:
    with opened(service) as socket, opened(service, scheme="Bearer") as other:
        about = msgpack.unpackb(socket.recv(timeout=60))
        assert about["action_dim"] == len(about["actions"]) == 8
        assert (about["task"], about["images"]) == ("reach", {})
        state = np.zeros(about["observations"]["observation/state"])
        right = asked(socket, **{"observation/state": state, "prompt": "reach the ball"})
        assert right["actions"].shape == (3, 8)
        assert right["server_timing"]["infer_ms"] > 0
        for seen, words in (
            ({"observation/state": state[1:]}, "'observation/state' is ("),
            ({"observation/state": "left"}, "numbers, got ()"),
            ({"policy": state}, "no observation 'policy' (not among what was sent: observation/state)"),
            ({"observation/state": state, "prompt": 3}, "the task in words"),
        ):
            assert words in asked(socket, **seen)
        for data, words in ((b"\xc1", "no msgpack"), (msgpack.packb([1]), "map of names"), ("text", "binary message")):
            socket.send(data)
            assert words in socket.recv(timeout=60)
        rng = np.random.default_rng(5)
        frame = openpi_wire.pack({"observation/state": state, "prompt": "x"})
        for _ in range(200):
            bytes_ = np.frombuffer(frame, np.uint8).copy()
            bytes_[rng.integers(0, len(bytes_), 3)] = rng.integers(0, 256, 3)
            socket.send(bytes_.tobytes())
            assert socket.recv(timeout=60)
        again = asked(socket, **{"observation/state": state})
        assert np.array_equal(again["actions"], right["actions"])
        other.recv(timeout=60)
        assert np.array_equal(asked(other, **{"observation/state": state})["actions"], right["actions"])


def test_keys_hosts_pages_and_the_number_of_clients(service: Any) -> None:
    for key, heads, status in (("wrong", {}, 401), ("", {}, 401), ("secret", {"Origin": "http://evil.example"}, 403)):
        with pytest.raises(InvalidStatus, match=str(status)), opened(service, key, **heads):
            pass
    with opened(service) as one, opened(service) as two:
        one.recv(timeout=60)
        two.recv(timeout=60)
        with pytest.raises(InvalidStatus, match="503"), opened(service):
            pass
    with pytest.raises(Exception, match="401"), urlopen(f"{service.address}/healthz"):
        pass


def test_a_policy_that_breaks_is_told_without_its_words(caplog: pytest.LogCaptureFixture) -> None:
    with serving_policy(
        "reach", f"{HERE}:broken", Settings(), engine="mujoco", overrides=OVERRIDES, clients=1
    ) as served:
        with connect(url(served), compression=None) as socket:
            size = msgpack.unpackb(socket.recv(timeout=60))["observations"]["policy"]
            assert asked(socket, policy=np.zeros(size)) == "the policy failed; the log of its server says why"
    assert "/somewhere/secret" in caplog.text


def test_policies_and_what_they_are_asked() -> None:
    with pytest.raises(TaskError, match="'expert' acts by what the simulator knows"):
        PolicyHost("reach", "expert", engine="mujoco", overrides=OVERRIDES, clients=1)
    with PolicyHost("reach", "random", engine="mujoco", overrides=OVERRIDES, clients=2) as host:
        size = host.metadata["observations"]["policy"]
        first = [host.infer(0, {"policy": np.zeros(size), "prompt": "to the left"}) for _ in range(2)]
        assert host._standing.instruction(0) == "to the left"  # pyright: ignore[reportPrivateUsage]
        assert host._standing.instruction(1) == host.metadata["prompt"]  # pyright: ignore[reportPrivateUsage]
        assert not np.array_equal(first[0], first[1])
        host.begin(0)
        assert np.array_equal(host.infer(0, {"policy": np.zeros(size)}), first[0])


@pytest.mark.skipif(importlib.util.find_spec("openpi_client") is None, reason="needs openpi-client: make test-vla")
def test_its_own_client_completes_an_episode(service: Any) -> None:
    from openpi_client.action_chunk_broker import ActionChunkBroker  # pyright: ignore[reportMissingImports]
    from openpi_client.websocket_client_policy import WebsocketClientPolicy  # pyright: ignore[reportMissingImports]

    asking = WebsocketClientPolicy(url(service), api_key="secret")
    assert asking.get_server_metadata()["task"] == "reach"
    broker = ActionChunkBroker(asking, action_horizon=3)
    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=list(OVERRIDES)) as env:
        env.reset(seed=2)
        expected: list[Any] = []
        while env.running.all():
            state = env.obs["policy"][0].astype(np.float32)
            if len(expected) % 3 == 0:
                chunk = leaning({"policy": env.obs["policy"]})[0]
            expected.append(chunk[len(expected) % 3])  # pyright: ignore[reportPossiblyUnboundVariable]
            action = broker.infer({"observation/state": state, "prompt": env.instruction(0)})["actions"]
            assert np.array_equal(action, expected[-1])
            env.step(action[None])
        assert len(expected) == 6
    with pytest.raises(RuntimeError, match="'observation/state' is"):
        asking.infer({"observation/state": np.zeros(2)})
    asking._ws.close()
