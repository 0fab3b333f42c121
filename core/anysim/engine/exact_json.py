"""Trees of plain values as JSON and back, exactly: integers of any size, tuples, numpy numbers, and no infinity lost.

What JSON lacks becomes a mapping of one key that begins with `~`; arrays are taken out of the tree.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import SnapshotError

_MARK = "~"


def encode(value: Any, arrays: dict[str, Array], where: str = "") -> Any:
    """The tree for JSON; arrays go into `arrays`, by their place in the tree.

    Raises:
        SnapshotError: a value that has no exact form, by its place.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biufSU":
            raise SnapshotError(f"{where} is an array of {value.dtype}, which has no place in a snapshot's file")
        arrays[where] = value
        return {f"{_MARK}array": where}
    if isinstance(value, np.generic):
        return {f"{_MARK}number": [value.dtype.str, encode(value.item(), arrays, where)]}
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else {f"{_MARK}float": str(float(value))}
    if isinstance(value, Mapping):
        if not all(isinstance(key, str) and not key.startswith(_MARK) for key in value):
            raise SnapshotError(f"{where} has keys that are no words, or begin with {_MARK}")
        return {key: encode(item, arrays, f"{where}/{key}" if where else key) for key, item in value.items()}
    if isinstance(value, list | tuple):
        items = [encode(item, arrays, f"{where}/{number}") for number, item in enumerate(value)]
        return items if isinstance(value, list) else {f"{_MARK}tuple": items}
    raise SnapshotError(
        f"{where} is a {type(value).__name__}, which has no place in a snapshot's file; numbers, words, arrays, and "
        f"tuples, lists and mappings of them have"
    )


def decode(tree: Any, arrays: Mapping[str, Array]) -> Any:
    """What `encode` was given.

    Raises:
        ValueError, KeyError, TypeError: it is not what `encode` made.
    """
    if isinstance(tree, list):
        return [decode(item, arrays) for item in tree]
    if not isinstance(tree, dict):
        return tree
    marked = [key for key in tree if key.startswith(_MARK)]
    if not marked:
        return {key: decode(item, arrays) for key, item in tree.items()}
    if len(tree) != 1:
        raise ValueError(f"{marked[0]} has company")
    return _MARKED[marked[0]](tree[marked[0]], arrays)


def _number(pair: Any, arrays: Mapping[str, Array]) -> np.generic:
    kind, value = pair
    dtype = np.dtype(kind)
    if dtype.hasobject:
        raise ValueError(f"{kind} is no type of numbers")
    return dtype.type(decode(value, arrays))


_MARKED: Mapping[str, Callable[[Any, Mapping[str, Array]], Any]] = {
    f"{_MARK}array": lambda name, arrays: arrays[name],
    f"{_MARK}number": _number,
    f"{_MARK}float": lambda word, _: float(word),
    f"{_MARK}tuple": lambda items, arrays: tuple(decode(item, arrays) for item in items),
}
