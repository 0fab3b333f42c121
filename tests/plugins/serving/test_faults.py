"""Faults between a client and a service: answers have a type, and other sessions do not notice."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from anysim.errors import TaskError
from anysim_client import wire
from anysim_client.errors import ConnectionLost, MalformedFrame, ServiceBusy, SessionGone, TookTooLong
from anysim_serving import socket as socket_module
from anysim_serving.server import Service
from anysim_serving.settings import Limits
from tests.plugins.serving.helpers import BLOCKS, connected, local, same, service

LIMITS = Limits(linger_s=0.3, idle_s=60.0, waiting=4, message_bytes=1 << 20)


@pytest.fixture(scope="module")
def made() -> Iterator[Service]:
    with service(limits=LIMITS) as one:
        yield one


@pytest.fixture
def bystander(made: Service) -> Iterator[Callable[[], None]]:
    """Steps another session, and holds it against a local env: whatever happens meanwhile, it is the same."""
    with connected(made, num_envs=2) as far, local(num_envs=2) as near:
        assert same(far.reset(seed=1), near.reset(seed=1))

        def goes_on() -> None:
            assert same(tuple(far.step(np.zeros((2, 0)))), tuple(near.step(np.zeros((2, 0)))))

        yield goes_on
        goes_on()


def sessions(made: Service) -> dict[str, Any]:
    return made.app.state.sessions.open


def until(true: Callable[[], bool], seconds: float = 30.0) -> None:
    ends = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < ends
        time.sleep(0.01)


def send(env: Any, data: bytes) -> dict[str, Any]:
    env.link._socket.send(data)
    return wire.unpack(env.link._socket.receive())


def test_a_client_that_vanishes_in_a_step_leaves_nothing(made: Service, bystander: Callable[[], None]) -> None:
    threads = threading.active_count()
    env = connected(made, num_envs=2)
    ident = env.link.id
    env.reset(seed=0)
    env.begin_step(np.zeros((2, 0)))
    env.link._socket._stream.close()
    bystander()
    until(lambda: ident not in sessions(made))
    bystander()
    until(lambda: threading.active_count() <= threads)


def test_a_lost_connection_is_taken_up_again(made: Service) -> None:
    with connected(made) as env, local() as near:
        env.reset(seed=0)
        near.reset(seed=0)
        env.link.drop()
        with pytest.raises(ConnectionLost):
            env.step(np.zeros((1, 0)))
        until(lambda: not sessions(made)[env.link.id].attached)
        env.link.attach()
        assert same(tuple(env.step(np.zeros((1, 0)))), tuple(near.step(np.zeros((1, 0)))))


def test_what_is_no_message_is_answered(made: Service, bystander: Callable[[], None]) -> None:
    with connected(made) as env:
        env.reset(seed=0)
        number = env.link._number
        for data, words in (
            (b"", "begins with"),
            (b"\x80" * 100, "begins with"),
            (wire.pack({"op": "step"}), "number `seq`"),
            (wire.pack({"op": "step", "seq": -1}), "number `seq`"),
            (wire.pack({"op": "step", "seq": number}), "sent before"),
            (wire.pack({"op": "close", "seq": number + 1}), "no operation"),
            (wire.pack({"op": ["step"], "seq": number + 2}), "no operation"),
            (wire.pack({"op": "step", "seq": number + 3, "images": "pickle"}), "images are sent"),
        ):
            error = send(env, data)["error"]
            assert error["type"] == "MalformedFrame"
            assert words in error["message"]
        for message, kind in (
            ({"op": "step", "action": "left"}, "TaskError"),
            ({"op": "step", "action": np.zeros((1, 0)), "mask": "all"}, "TaskError"),
            ({"op": "reset", "seed": "x"}, "TaskError"),
            ({"op": "reset", "overrides": "x"}, "TaskError"),
            ({"op": "reset_to", "snapshot": {"stamp": {}}}, "SnapshotError"),
            ({"op": "observe", "keys": ["nothing"]}, "TaskError"),
            ({"op": "render", "size": "large"}, "TaskError"),
            ({"op": "render", "env_ids": [9]}, "EngineError"),
            ({"op": "retire", "env_ids": [9]}, "EngineError"),
        ):
            number += 10
            assert send(env, wire.pack({"seq": number, **message}))["error"]["type"] == kind, message
        env.link._number = number
        bystander()
        env.step(np.zeros((1, 0)))


def test_text_is_not_read(made: Service) -> None:
    with connected(made) as env:
        env.link._socket._send(1, b"step")
        assert "binary" in wire.unpack(env.link._socket.receive())["error"]["message"]


def test_a_message_that_is_too_large_ends_its_connection(made: Service, bystander: Callable[[], None]) -> None:
    env = connected(made)
    with pytest.raises(ConnectionLost):
        env.step(np.zeros((1, 200_000)))
    bystander()
    env.close()


def test_more_than_may_wait_is_busy(made: Service, bystander: Callable[[], None]) -> None:
    """While one operation goes on, the first few that follow wait, and the rest are refused; all are answered."""
    with connected(made) as env:
        env.reset(seed=0)
        go_on = threading.Event()
        session = sessions(made)[env.link.id]
        session.simulator.submit(lambda _: go_on.wait(30))
        number = env.link._number
        for i in range(10):
            env.link._socket.send(wire.pack({"op": "observe", "seq": number + 1 + i}))
        until(lambda: session.counts["errors"] >= 6)
        bystander()
        go_on.set()
        answers = [wire.unpack(env.link._socket.receive()) for _ in range(10)]
        busy = [answer["error"]["type"] for answer in answers if "error" in answer]
        assert busy == [ServiceBusy.__name__] * len(busy)
        assert len(busy) in (6, 7)  # the first of the others may wait beside the one that is worked on
        env.link._number += 10
        env.step(np.zeros((1, 0)))


def test_a_step_during_a_reset_comes_after_it(made: Service) -> None:
    """One thread has the simulator: what is sent while it works is done in order, and answered in order."""
    with connected(made, num_envs=2) as env, local(num_envs=2) as near:
        number = env.link._number
        for i, message in enumerate(
            [
                {"op": "step", "action": np.zeros((2, 0))},
                {"op": "reset", "seed": 5},
                {"op": "step", "action": np.zeros((2, 0))},
            ]
        ):
            env.link._socket.send(wire.pack({"seq": number + 1 + i, **message}))
        early, reset, step = (wire.unpack(env.link._socket.receive()) for _ in range(3))
        near.reset(seed=5)
        assert early["error"]["type"] == TaskError.__name__
        assert reset["ok"]["running"].all()
        assert same(step["ok"]["obs"], near.step(np.zeros((2, 0))).obs)


def test_a_client_that_does_not_read_holds_up_itself(
    made: Service, bystander: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its answers fill what lies between, then no more is sent, and at last its connection is taken for dead."""
    monkeypatch.setattr(socket_module, "SEND_S", 0.5)
    env = connected(made, num_envs=8)
    env.reset(seed=0)
    session = sessions(made)[env.link.id]
    number = env.link._number
    for _ in range(2000):
        done = session.counts["bytes_out"]
        for _ in range(LIMITS.waiting):
            number += 1
            if session.attached:
                env.link._socket.send(wire.pack({"op": "snapshot", "seq": number}))
        until(lambda done=done: session.counts["bytes_out"] > done or not session.attached)
        if not session.attached:
            break
    assert not session.attached
    assert session.counts["bytes_out"] < 60 << 20
    bystander()
    until(lambda: session.id not in sessions(made))
    env.close()


def test_a_service_that_ends_and_comes_back() -> None:
    """Sessions end with it; the client is told, and connects anew."""
    with service(BLOCKS) as one:
        env = connected(one)
        env.reset(seed=0)
        simulator = sessions(one)[env.link.id].simulator
    assert simulator.join(0)
    with pytest.raises(ConnectionLost):
        env.step(np.zeros((1, 0)))
    with pytest.raises(ConnectionLost):
        env.reset()
    env.close()
    with service(BLOCKS) as one, connected(one) as again:
        again.reset(seed=0)


def test_unused_sessions_end() -> None:
    with service(limits=Limits(idle_s=0.2, linger_s=0.2)) as one:
        env = connected(one)
        env.reset(seed=0)
        until(lambda: not sessions(one))
        with pytest.raises((ConnectionLost, SessionGone)):
            env.step(np.zeros((1, 0)))
        assert one.app.state.sessions.total["ended_idle"] == 1
        env.close()


def test_an_operation_that_takes_too_long_ends_its_session() -> None:
    with service(limits=Limits(op_s=0.3)) as one:
        env = connected(one)
        stuck = threading.Event()
        sessions(one)[env.link.id].simulator.submit(lambda _: stuck.wait(20))
        try:
            with pytest.raises((TookTooLong, ConnectionLost)):
                env.reset(seed=0)
            until(lambda: not sessions(one))
        finally:
            stuck.set()
        env.close()


def test_a_bug_is_told_without_its_words(made: Service, caplog: pytest.LogCaptureFixture) -> None:
    """What no input explains is in the service's log, and not in the answer: it may hold paths."""
    with connected(made) as env:
        env.reset(seed=0)

        def broken(engine_env: Any) -> None:
            def step(*_: Any) -> None:
                raise RuntimeError("somewhere/secret")

            engine_env.step = step

        sessions(made)[env.link.id].simulator.submit(broken).result()
        with pytest.raises(Exception, match="the service failed") as raised:
            env.step(np.zeros((1, 0)))
        assert type(raised.value).__name__ == "EngineFailure"
        assert "secret" not in str(raised.value)
        assert "secret" in caplog.text
        assert env.obs["policy"].shape == (1, 10)  # the session goes on


def fuzz(made: Service, count: int) -> None:
    """Changed messages to a live session: each is answered, and the session is whole afterwards."""
    rng = np.random.default_rng(1)
    with connected(made, num_envs=2) as env:
        env.reset(seed=0)
        words = [
            {"op": "step", "action": np.zeros((2, 0))},
            {"op": "reset", "seed": 3, "mask": np.array([True, False])},
            {"op": "observe", "keys": ["policy"]},
            {"op": "retire", "env_ids": np.array([0])},
        ]
        for number in range(count):
            message = words[rng.integers(len(words))]
            frame = np.frombuffer(wire.pack({"seq": 1000 + number, **message}), np.uint8).copy()
            for place in rng.integers(0, len(frame), rng.integers(0, 5)):
                frame[place] = rng.integers(0, 256)
            cut = frame[: rng.integers(0, len(frame))] if rng.random() < 0.1 else frame
            answer = send(env, cut.tobytes())
            assert "ok" in answer or answer["error"]["type"] in (
                "MalformedFrame",
                "TaskError",
                "EngineError",
                "LimitExceeded",
                "SnapshotError",
            ), answer
    with connected(made, num_envs=2) as far, local(num_envs=2) as near:
        assert same(far.reset(seed=1), near.reset(seed=1))


def test_changed_messages_are_answered(made: Service, bystander: Callable[[], None]) -> None:
    fuzz(made, 300)
    bystander()


@pytest.mark.slow
@pytest.mark.full
def test_ten_thousand_changed_messages_are_answered(made: Service) -> None:
    fuzz(made, 10_000)
    assert MalformedFrame.status == 400
