"""Policies behind openpi's protocol: what travels, chunks, and servers that are gone, slow or failing."""

import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import msgpack
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

import anysim
from anysim.errors import SpecError, TaskError
from anysim_evaluation.driver import drive, episode_seeds
from anysim_evaluation.policy import make_policy, parse
from anysim_policy import openpi_wire
from anysim_policy.openpi import OpenPiEnvPolicy

Infer = Callable[[dict[str, Any]], Any]


def sent(array: np.ndarray[Any, Any]) -> dict[bytes, Any]:
    """An array as the servers of others pack it."""
    return {b"__ndarray__": True, b"data": array.tobytes(), b"dtype": array.dtype.str, b"shape": array.shape}


def read(value: Any) -> Any:
    """What arrived, with arrays where a server of others would have them."""
    if isinstance(value, dict) and b"__ndarray__" in value:
        return np.frombuffer(value[b"data"], value[b"dtype"]).reshape(value[b"shape"])
    return value


@contextmanager
def server(infer: Infer, greeting: Any = None) -> Iterator[str]:
    """A policy server: `infer` answers a map with a map, words (a failure), bytes as they are, or None: it hangs up."""

    def talk(socket: ServerConnection) -> None:
        socket.send(greeting if isinstance(greeting, bytes) else msgpack.packb(greeting or {"policy": "test"}))
        try:
            while True:
                asked = msgpack.unpackb(socket.recv())
                answer = infer({key: read(value) for key, value in asked.items()})
                if answer is None:
                    return
                socket.send(msgpack.packb(answer) if isinstance(answer, dict) else answer)
        except ConnectionClosed:
            return

    with serve(talk, "127.0.0.1", 0, compression=None) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{running.socket.getsockname()[1]}"
        finally:
            running.shutdown()
            thread.join()


@contextmanager
def asked(url: str, num_envs: int = 1, **options: Any) -> Iterator[tuple[Any, OpenPiEnvPolicy]]:
    with anysim.make("reach", engine="mujoco", num_envs=num_envs, overrides=["record.cameras=[]"]) as env:
        env.reset(seed=1)
        policy = OpenPiEnvPolicy(env, url=url, **options)
        try:
            yield env, policy
        finally:
            policy.close()


def zeros(*shape: int) -> Infer:
    return lambda _: {"actions": sent(np.zeros(shape, np.float32))}


def test_arrays_travel_bit_by_bit() -> None:
    for array in (np.arange(6, dtype=np.uint8).reshape(1, 2, 3), np.eye(2, dtype=">f4"), np.zeros((0, 3)), np.array(2)):
        back = openpi_wire.unpack(openpi_wire.pack({"a": array, "n": array.dtype.type(1)}))
        assert np.array_equal(back["a"], array)
        assert back["a"].dtype == array.dtype
        assert back["n"] == 1
    theirs = msgpack.packb({"a": sent(np.array([1.5, 2.0]))})
    assert openpi_wire.pack({"a": np.array([1.5, 2.0])}) == theirs
    assert openpi_wire.unpack(theirs)["a"].tolist() == [1.5, 2.0]
    with pytest.raises(TypeError, match="a ndarray does not travel"):
        openpi_wire.pack({"a": np.array([object()])})
    hostile = {b"__ndarray__": True, b"data": b"x" * 8, b"dtype": "O", b"shape": (1,)}
    for wrong, message in (
        (msgpack.packb(hostile), "arrays of object are not read"),
        (msgpack.packb(hostile | {b"dtype": "<f4", b"shape": (9,)}), "cannot reshape"),
        (msgpack.packb({b"__ndarray__": True}), "no msgpack of plain arrays"),
        (b"\xc1", "no msgpack of plain arrays"),
        (b"\x81\xa1a", "incomplete"),
    ):
        with pytest.raises(ValueError, match=message):
            openpi_wire.unpack(wrong)


def test_ten_thousand_changed_messages_are_read_or_refused() -> None:
    """Nothing but ValueError comes out, and no array of another kind."""
    rng, refused = np.random.default_rng(2), 0
    frame = openpi_wire.pack({"a": np.arange(3.0), "n": np.float32(2.0), "prompt": "to the left"})
    for _ in range(10_000):
        bytes_ = np.frombuffer(frame, np.uint8).copy()
        bytes_[rng.integers(0, len(bytes_), 3)] = rng.integers(0, 256, 3)
        try:
            message = openpi_wire.unpack(bytes_.tobytes())
        except ValueError:
            refused += 1
            continue
        arrays = [value for value in (message.values() if isinstance(message, dict) else ()) if hasattr(value, "dtype")]
        assert all(array.dtype.kind in "biuf" for array in arrays)
    assert 1000 < refused < 10_000


def test_each_env_sends_its_observation_and_gets_its_chunk() -> None:
    seen: list[dict[str, Any]] = []

    def infer(obs: dict[str, Any]) -> dict[str, Any]:
        seen.append(obs)
        return {"actions": sent(np.full((5, 8), obs["observation/state"][0])), "server_timing": {"infer_ms": 1.0}}

    with server(infer) as url, asked(url, 3, keys="observation/state:policy", steps=2) as (env, policy):
        assert policy.metadata == {"policy": "test"}
        obs = {"policy": env.obs["policy"].copy()}
        obs["policy"][1, 1] = np.nan
        rows = np.array([0, 2])
        given = policy.act({"policy": obs["policy"][:2]}, rows)
        assert given.shape == (2, 2, 8)
        assert np.array_equal(given[:, 0, 0], obs["policy"][:2, 0].astype(np.float32).astype(float))
        assert [set(one) for one in seen] == [{"observation/state", "prompt"}] * 2
        assert seen[1]["prompt"] == env.instruction(2) != ""
        assert seen[1]["observation/state"].dtype == np.float32
        assert seen[1]["observation/state"][1] == 0.0


def test_episodes_of_a_policy_behind_a_server() -> None:
    calls: list[int] = []

    def infer(obs: dict[str, Any]) -> dict[str, Any]:
        calls.append(1)
        return {"actions": sent(np.zeros((4, 8), np.float32))}

    overrides = ["record.cameras=[]", "task.horizon=8"]
    with server(infer) as url, anysim.make("reach", engine="mujoco", num_envs=2, overrides=overrides) as env:
        seeds = episode_seeds("validation", 0, 3)
        policy = make_policy(env, f"openpi:{url},timeout=20,steps=2")
        found = sorted(drive(env, policy, seeds), key=lambda e: e.seed)
        zero = sorted(drive(env, make_policy(env, "zero"), seeds), key=lambda e: e.seed)
        policy.close()  # pyright: ignore[reportAttributeAccessIssue]
    assert found == zero
    assert len(calls) == 3 * 8 / 2


def test_an_image_travels_as_it_is() -> None:
    sizes: list[Any] = []

    def infer(obs: dict[str, Any]) -> dict[str, Any]:
        sizes.append((obs["image"].dtype, obs["image"].shape, obs["image"].sum()))
        return {"actions": sent(np.zeros(8))}

    image = np.random.default_rng(0).integers(0, 255, (2, 6, 4, 3), dtype=np.uint8)
    with server(infer) as url, asked(url) as (env, policy):
        env.image_shapes["images/front"] = (6, 4, 3)
        policy._keys = policy._named("image:images/front")  # pyright: ignore[reportPrivateUsage]
        assert policy.act({"images/front": image[1:]}, np.array([0])).shape == (1, 1, 8)
    assert sizes == [(np.uint8, (6, 4, 3), image[1].sum())]


def test_a_server_that_is_not_there() -> None:
    with server(zeros(8)) as url:
        pass
    with pytest.raises(TaskError, match=rf"{re.escape(url)} cannot be reached \(.+\); start it"), asked(url):
        pass
    with pytest.raises(TaskError, match="cannot be reached"), asked("http://127.0.0.1:1"):
        pass


def test_a_server_that_hangs_up_or_fails() -> None:
    with server(lambda _: None) as url, asked(url) as (env, policy):
        with pytest.raises(TaskError, match=r"is gone .*; start it, then the same command goes on"):
            policy.act(env.obs, np.array([0]))
    trouble = "Traceback (most recent call last):\n  …\nKeyError: 'observation/image'\n"
    with server(lambda _: trouble) as url, asked(url) as (env, policy):
        with pytest.raises(TaskError, match=r"failed: KeyError: 'observation/image'$"):
            policy.act(env.obs, np.array([0]))


def test_a_server_that_takes_too_long() -> None:
    wait = threading.Event()

    def infer(_: Any) -> None:
        wait.wait(20.0)

    with server(infer) as url, asked(url, timeout=0.3) as (env, policy):
        began = time.perf_counter()
        with pytest.raises(TaskError, match=r"gave no answer within 0\.3 s"):
            policy.act(env.obs, np.array([0]))
        assert time.perf_counter() - began < 10.0
        wait.set()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({"actions": sent(np.zeros((4, 7)))}, r"gave actions \(4, 7\); 'reach' takes \(8,\) or \(K, 8\)"),
        ({"actions": sent(np.zeros((0, 8)))}, r"gave actions \(0, 8\)"),
        ({"actions": sent(np.zeros((1, 2, 8)))}, r"gave actions \(1, 2, 8\)"),
        ({"action": [0.0]}, r"none under 'actions' \(action\)"),
        ({"actions": sent(np.full(8, np.nan))}, "no finite numbers"),
        (b"\xc1", "does not speak openpi's protocol"),
        (msgpack.packb([1, 2]), "it sent a list, not a map"),
    ],
)
def test_answers_that_are_no_actions(answer: Any, message: str) -> None:
    with server(lambda _: answer) as url, asked(url) as (env, policy):
        with pytest.raises(TaskError, match=message):
            policy.act(env.obs, np.array([0]))


def test_chunks_of_different_lengths() -> None:
    lengths = iter([3, 2, 3, 2])
    with server(lambda _: {"actions": sent(np.zeros((next(lengths), 8)))}) as url:
        with asked(url, 2) as (env, policy), pytest.raises(TaskError, match=r"chunks of 2, 3 steps .* steps=2"):
            policy.act(env.obs, np.arange(2))
        with asked(url, 2, steps=2) as (env, policy):
            assert policy.act(env.obs, np.arange(2)).shape == (2, 2, 8)


def test_names_that_are_not_there() -> None:
    with server(zeros(8)) as url:
        for keys in ("state:polcy", "policy", "a:policy+a:policy", "prompt:policy"):
            with pytest.raises(TaskError, match=r"policy\.keys: "), asked(url, keys=keys):
                pass
        with asked(url) as (_, policy), pytest.raises(TaskError, match="to be sent policy; --privileged shows it"):
            policy.act({}, np.array([0]))


def test_addresses_on_the_command_line() -> None:
    assert parse("openpi:ws://127.0.0.1:8000") == ("openpi", {"url": "ws://127.0.0.1:8000"}, "")
    assert parse("openpi:ws://h/?a=b,timeout=5").options == {"url": "ws://h/?a=b", "timeout": 5.0}
    assert parse("openpi:url=ws://h,keys=a/b:policy+c:images/front").options == {
        "url": "ws://h",
        "keys": "a/b:policy+c:images/front",
    }
    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=["record.cameras=[]"]) as env:
        with pytest.raises(SpecError, match=r"policy\.url"):
            make_policy(env, "openpi")
