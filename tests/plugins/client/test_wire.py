"""Frames: everything that travels comes back as it was, and what is no frame is refused with a sentence."""

from typing import Any

import msgpack
import numpy as np
import pytest

from anysim_client import wire
from anysim_client.errors import MalformedFrame
from tests.plugins.serving.helpers import same

MESSAGE: dict[str, Any] = {
    "op": "step",
    "seq": 3,
    "large": 1 << 127,
    "nothing": None,
    "words": ["a", "ü", ("pair", 1)],
    "number": np.uint64(1 << 63),
    "limits": {"low": float("-inf"), "half": 0.5},
    "arrays": {
        "float": np.arange(6, dtype=np.float32).reshape(2, 3).T,
        "nan": np.array([np.nan, -0.0]),
        "flag": np.array([True, False]),
        "word": np.array(["running", "failed"]),
        "none": np.zeros((0, 7)),
        "scalar": np.array(3),
    },
}


def test_a_message_comes_back_as_it_was() -> None:
    frame = wire.pack(MESSAGE)
    assert wire.pack(MESSAGE) == frame
    again = wire.unpack(frame)
    assert again["arrays"]["float"].dtype == np.float32
    again["words"], given = tuple(again["words"]), MESSAGE | {"words": tuple(MESSAGE["words"])}
    assert same(again, given)
    writable = wire.unpack(np.frombuffer(frame, np.uint8).copy())
    writable["arrays"]["float"][0, 0] = 9


@pytest.mark.parametrize(
    "value", [np.array([object()]), np.zeros(2, complex), np.zeros(2, "V3"), b"bytes", {1: 2}, {"~array": 1}, set()]
)
def test_what_cannot_travel_is_refused(value: Any) -> None:
    with pytest.raises(MalformedFrame):
        wire.pack({"value": value})


def forged(tree: Any, arrays: Any, body: bytes = b"") -> bytes:
    head = msgpack.Packer().pack({"tree": tree, "arrays": arrays})
    return b"ASF1" + len(head).to_bytes(4, "little") + head + body


@pytest.mark.parametrize(
    "frame",
    [
        b"",
        b"ASF1",
        b"GET / HTTP/1.1\r\n",
        b"ASF1\xff\xff\xff\xff",
        b"ASF1" + (5).to_bytes(4, "little") + b"\xc1\xc1\xc1\xc1\xc1",
        b"ASF1" + (1000).to_bytes(4, "little") + b"\x91" * 1000,
        forged([], []),
        forged({}, {}),
        forged({"a": {"~array": "a"}}, []),
        forged({}, [["a", "|O", [1]]], bytes(128)),
        forged({}, [["a", "<c16", [1]]], bytes(128)),
        forged({}, [["a", "|V8", [1]]], bytes(128)),
        forged({}, [["a", "<f8", [1 << 62, 1 << 62]]], bytes(128)),
        forged({}, [["a", "<f8", [-1]]], bytes(128)),
        forged({}, [["a", "<f8", [True]]], bytes(128)),
        forged({}, [["a", "<f8", "1"]], bytes(128)),
        forged({}, [["a", "<f8", [1]]]),
        forged({}, [], b"more"),
        forged({}, [["a", "|u1", [0]]] * 5000),
        forged({"a": {"~number": ["|O", 1]}}, []),
        forged({"a": {"~float": "x"}}, []),
        forged({"a": {"~code": "x"}}, []),
        forged({"a": {"~int": "0x" + "f" * 100 + "g"}}, []),
        forged({"a": msgpack.ExtType(1, b"x")}, []),
    ],
)
def test_what_is_no_frame_is_refused(frame: bytes) -> None:
    with pytest.raises(MalformedFrame):
        wire.unpack(frame)


def fuzzed(count: int) -> tuple[int, int]:
    """How many changed frames are refused, and how many still say something."""
    rng, frame = np.random.default_rng(0), np.frombuffer(wire.pack(MESSAGE), np.uint8)
    refused = 0
    for _ in range(count):
        changed = frame.copy()
        for place in rng.integers(0, len(frame) if rng.random() < 0.3 else 420, rng.integers(1, 6)):
            changed[place] = rng.integers(0, 256)
        if rng.random() < 0.2:
            changed = changed[: rng.integers(0, len(frame))]
        try:
            assert isinstance(wire.unpack(changed), dict)
        except MalformedFrame:
            refused += 1
    return refused, count - refused


def test_changed_frames_are_refused_or_read() -> None:
    refused, read = fuzzed(2000)
    assert refused > 500
    assert read > 50


@pytest.mark.slow
def test_many_changed_frames_are_refused_or_read() -> None:
    assert sum(fuzzed(40000)) == 40000
