"""The messages of openpi's policy servers: msgpack maps whose arrays are maps with bytes as keys."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.errors import PluginError

try:
    import msgpack
except ImportError as error:
    raise PluginError(f"policy servers need msgpack ({error}): pip install 'anysim-policy[openpi]'") from None

_KINDS = "biuf"
"""Kinds of numpy types that travel: truth values and numbers. Objects and records would be code of the sender's."""


def pack(message: Mapping[str, Any]) -> bytes:
    """A message as bytes; arrays as `{b"__ndarray__", b"data", b"dtype", b"shape"}`, in C order."""
    packed: bytes | None = msgpack.packb(dict(message), default=_plain)
    assert packed is not None
    return packed


def unpack(data: bytes) -> Any:
    """The message in bytes.

    Raises:
        ValueError: it is no message of this form.
    """
    try:
        return msgpack.unpackb(data, object_hook=_array)
    except (msgpack.UnpackException, TypeError, KeyError, OverflowError, SyntaxError, RecursionError) as error:
        raise ValueError(f"no msgpack of plain arrays ({error!r})") from error


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.kind in _KINDS:
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
    if isinstance(value, np.generic) and value.dtype.kind in _KINDS:
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"a {type(value).__name__} does not travel to a policy server")


def _array(found: dict[Any, Any]) -> Any:
    if b"__ndarray__" not in found and b"__npgeneric__" not in found:
        return found
    dtype = np.dtype(found[b"dtype"])
    if dtype.kind not in _KINDS:
        raise ValueError(f"arrays of {dtype} are not read")
    if b"__npgeneric__" in found:
        with np.errstate(all="ignore"):  # a number beyond its type is infinite, and refused where it is used
            return dtype.type(found[b"data"])
    return np.frombuffer(found[b"data"], dtype).reshape(found[b"shape"])
