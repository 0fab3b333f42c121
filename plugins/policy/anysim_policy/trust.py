"""Trust in model files: TorchScript only from trusted folders, ONNX data only beside its model.

TorchScript files hold programs and pickles, and torch promises nothing about hostile ones; no file says of itself that
it is trusted, so the folders are named in the environment. ONNX is data; what it names outside of itself is checked.
"""

import os
from collections.abc import Iterator
from pathlib import Path

from anysim.errors import TaskError
from anysim_schemas.files import RefusedFileError, read_plain
from anysim_schemas.limits import POLICY_BYTES

TRUSTED = "ANYSIM_TRUSTED_POLICIES"
"""The environment variable with the folders of trusted TorchScript files, separated as in PATH."""

_NESTED: dict[str, dict[int, str]] = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node", 11: "attribute"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
    "tensor": {13: "external"},
}
"""The messages of ONNX in which tensors may be, by field number."""

_DEPTH = 100  # as protobuf's own


def check_torch(path: Path) -> None:
    """Raises TaskError unless a TorchScript file lies in a trusted folder."""
    roots = [Path(part).resolve() for part in os.environ.get(TRUSTED, "").split(os.pathsep) if part]
    if not any(path.resolve().is_relative_to(root) for root in roots):
        raise TaskError(
            f"the policy {path} is TorchScript, which can run code of its own, and lies in no trusted folder: export "
            f"it to ONNX, or name its folder in {TRUSTED} if you trust its author"
        )


def check_onnx(path: Path) -> None:
    """Raises TaskError where an ONNX file is too large, or names data outside of its folder."""
    folder = path.parent.resolve()
    try:
        data = read_plain(path, POLICY_BYTES)
        size, seen = len(data), set[Path]()
        for location in _locations(memoryview(data), "model", 0):
            file = (folder / location).resolve()
            if not location or not file.is_relative_to(folder):
                raise TaskError(
                    f"the policy {path} keeps data in '{location}', outside of its folder; save it with its data inside"
                )
            if not file.is_file():
                raise TaskError(f"the policy {path} keeps data in '{location}', which is no file of its folder")
            size += 0 if file in seen else file.stat().st_size
            seen.add(file)
        if POLICY_BYTES.exceeded(size):
            raise TaskError(f"the policy {path} with its data {POLICY_BYTES.sentence(size)}")
    except RefusedFileError as error:
        raise TaskError(f"the policy {path} {error.strerror}") from error
    except (OSError, ValueError, IndexError) as error:
        raise TaskError(f"the policy {path} is no ONNX model: {error}") from error


def _locations(data: memoryview, message: str, depth: int) -> Iterator[str]:
    """The `location`s of external data in a message, however deep."""
    if depth > _DEPTH:
        raise ValueError(f"its messages are nested more than {_DEPTH} deep")
    for number, value in _fields(data):
        kind = _NESTED[message].get(number)
        if kind == "external":
            pair = {key: bytes(text) for key, text in _fields(value)}
            if pair.get(1) == b"location":
                yield pair.get(2, b"").decode()
        elif kind is not None:
            yield from _locations(value, kind, depth + 1)


def _fields(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Number and bytes of the fields of a protobuf message that have a length; others are passed over."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        wire = key & 7
        if wire == 0:
            _, at = _varint(data, at)
        elif wire in (1, 5):
            at += 8 if wire == 1 else 4
        elif wire == 2:
            length, at = _varint(data, at)
            if length > len(data) - at:
                raise ValueError("it ends in the middle of a field")
            yield key >> 3, data[at : at + length]
            at += length
        else:
            raise ValueError(f"it has a field of the unknown kind {wire}")


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at
        if shift > 63:
            raise ValueError("it has a number of more than 64 bits")
